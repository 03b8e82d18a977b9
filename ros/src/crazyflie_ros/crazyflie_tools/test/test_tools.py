"""The tools in this process, on a vehicle with scripted answers."""

import threading

import pytest

from crazyflie_link.errors import NoDongleError
from crazyflie_tools import tools


@pytest.fixture
def answer(vehicle, capsys):
    """Return ``answer(tool, *arguments)``: exit status, lines printed, lines of errors."""

    def answer(tool, *arguments):
        status = tool([*arguments, "--uri", vehicle.uri])
        printed = capsys.readouterr()
        return status, printed.out.splitlines(), printed.err.splitlines()

    return answer


def usage_error(tool, capsys, *arguments):
    """Return the message of a tool about arguments that are wrong."""
    with pytest.raises(SystemExit) as exit_:
        tool(list(arguments))
    printed = capsys.readouterr()
    assert exit_.value.code == 2
    assert not printed.out
    return printed.err


def test_parameters_are_listed_with_type_and_value(answer):
    assert answer(tools.list_params) == (
        0,
        [
            "cpu.id0 (uint32, readonly) 4294967295",
            "motor.trim (int8) -3",
            "pid_rate.roll_kp (float) 0.1",
            "ring.effect (uint8) 6",
        ],
        [],
    )


def test_log_variables_are_listed_with_type(answer):
    lines = ["pm.vbat (float)", "radio.rssi (uint8)", "stateEstimate.x (float)"]
    assert answer(tools.list_log_variables) == (0, lines, [])


def test_values_come_in_the_order_asked_for(answer):
    names = ("ring.effect", "pid_rate.roll_kp", "motor.trim")
    assert answer(tools.get_param, *names) == (0, ["6", "0.1", "-3"], [])


def test_names_may_be_written_as_ros_writes_them(answer):
    assert answer(tools.get_param, "ring/effect", "/motor/trim") == (0, ["6", "-3"], [])
    assert answer(tools.set_param, "ring/effect", "5") == (0, ["5"], [])


def test_an_unknown_name_is_an_error_with_a_suggestion(answer):
    status, lines, (error,) = answer(tools.get_param, "motor.trim", "ring.efect")
    assert (status, lines) == (1, [])
    assert error.startswith("getParam: the vehicle has no parameter 'ring.efect'")
    assert "did you mean ring.effect?" in error


@pytest.mark.parametrize(
    ("name", "text", "printed", "value"),
    [
        ("ring.effect", "0x11", "17", 17),
        ("motor.trim", "-5", "-5", -5),
        ("motor.trim", "5.0", "5", 5),
        ("pid_rate.roll_kp", "0.3", "0.3", pytest.approx(0.3)),
        ("pid_rate.roll_kp", "-2", "-2.0", -2.0),
    ],
)
def test_the_vehicle_gets_a_value_and_confirms_it(answer, vehicle, name, text, printed, value):
    assert answer(tools.set_param, name, text) == (0, [printed], [])
    assert vehicle.parameters[name][1] == value


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("ring.effect", "256", "uint8_t; 256 does not fit"),
        ("ring.effect", "1.5", "uint8_t; 1.5 does not fit"),
        ("pid_rate.roll_kp", "1e39", "float; 1e+39 does not fit"),
        ("cpu.id0", "1", "can only be read"),
        ("wing.span", "1", "no parameter 'wing.span'"),
    ],
)
def test_a_value_that_cannot_be_set_is_an_error(answer, vehicle, name, text, reason):
    before = dict(vehicle.parameters)
    status, lines, (error,) = answer(tools.set_param, name, text)
    assert (status, lines) == (1, [])
    assert error.startswith("setParam: ")
    assert reason in error
    assert vehicle.parameters == before


@pytest.mark.parametrize(
    ("tool", "arguments", "reason"),
    [
        (tools.get_param, ("--uri", "radio://0/25/2M/E7E7E7E701"), "required: GROUP.NAME"),
        (tools.get_param, ("a.b", "--uri", "radio:0"), "not an address of a vehicle"),
        (tools.get_param, ("a.b", "--uri", "radio://0/126/2M"), "no radio channel 126"),
        (tools.set_param, ("a.b", "on"), "'on': expected a finite number"),
        (tools.set_param, ("a.b", "nan"), "expected a finite number"),
        (tools.list_params, ("extra",), "unrecognized arguments: extra"),
        (tools.list_log_variables, ("--timeout", "0"), "seconds above 0"),
        (tools.console, ("--duration", "inf"), "seconds above 0"),
        (tools.scan, ("--address", "E7E7E7E7E7E7"), "up to 10 hexadecimal digits"),
        (tools.scan, ("--address", "0x"), "up to 10 hexadecimal digits"),
        (tools.scan, ("--address", "-1"), "--address"),
        (tools.reboot, ("--uri", "udp://localhost"), "not an address of a vehicle"),
    ],
)
def test_wrong_usage_is_reported_before_anything_is_sent(capsys, tool, arguments, reason):
    assert reason in usage_error(tool, capsys, *arguments)


def test_the_console_is_printed_line_by_line_until_the_link_is_lost(answer, vehicle):
    def speak():
        # Reading the tables comes before the vehicle is frozen: wait for a ping.
        vehicle.wait_for_packets(15, 0, 3)
        for piece in (b"SYS: up and ", b"running\nESTIMATOR: Kal", b"man\n"):
            vehicle.send(0, 0, piece)
        vehicle.is_frozen = True

    speaker = threading.Thread(target=speak)
    speaker.start()
    status, lines, (error,) = answer(tools.console, "--duration", "60")
    speaker.join()
    assert (status, lines) == (1, ["SYS: up and running", "ESTIMATOR: Kalman"])
    assert error.startswith("console: ")
    assert "has not been heard for 0.45 s" in error


def test_the_console_ends_after_its_duration(answer):
    assert answer(tools.console, "--duration", "0.2") == (0, [], [])


def test_only_a_radio_can_restart_a_vehicle(answer, vehicle):
    status, lines, (error,) = answer(tools.reboot)
    assert (status, lines) == (1, [])
    assert error.startswith(f"reboot: {vehicle.uri}: only a radio link can restart a vehicle")
    assert not vehicle.received


@pytest.mark.parametrize(
    ("arguments", "called"),
    [
        ((), "reboot_to_fw"),
        (("--mode", "firmware"), "reboot_to_fw"),
        (("--mode", "bootloader"), "reboot_to_bootloader"),
        (("--mode", "sysoff"), "stm_power_down"),
        (("--mode", "syson"), "stm_power_up"),
        (("--mode", "alloff"), "platform_power_down"),
    ],
)
def test_the_radio_restarts_the_vehicle(monkeypatch, arguments, called):
    calls = []

    class Switch:
        def __init__(self, uri):
            calls.append(uri)

        def __getattr__(self, name):
            return lambda: calls.append(name)

    monkeypatch.setattr("crazyflie_link.crazyflie.PowerSwitch", Switch)
    uri = "radio://0/25/2M/E7E7E7E701"
    assert tools.reboot(["--uri", uri, *arguments]) == 0
    assert calls == [uri, called, "close"]


@pytest.fixture
def searched(monkeypatch):
    """Return the addresses that were searched for, and let ``.result`` be found."""

    class Searched(list):
        result = ([], [])

        def __call__(self, address):
            self.append(address)
            return self.result

    searched = Searched()
    monkeypatch.setattr("crazyflie_link.crazyflie.scan", searched)
    return searched


@pytest.mark.parametrize(
    ("arguments", "address"),
    [
        ((), "E7E7E7E7E7"),
        (("--address", "E7E7E7E701"), "E7E7E7E701"),
        (("--address", "0xe7e7e7e702"), "E7E7E7E702"),
    ],
)
def test_vehicles_are_searched_by_address(capsys, searched, arguments, address):
    searched.result = (["radio://0/25/2M/" + address, "udp://127.0.0.1:19850"], [])
    assert tools.scan(list(arguments)) == 0
    assert searched == [address]
    assert capsys.readouterr().out.splitlines() == searched.result[0]


def test_where_no_vehicle_is_found_the_reasons_are_printed(capsys, searched):
    searched.result = ([], [NoDongleError("RadioDriver: no Crazyradio dongle found")])
    assert tools.scan([]) == 1
    printed = capsys.readouterr()
    assert not printed.out
    assert printed.err.splitlines() == [
        "scan: no vehicle found by radio (address E7E7E7E7E7), by USB or by UDP",
        "  RadioDriver: no Crazyradio dongle found",
    ]
