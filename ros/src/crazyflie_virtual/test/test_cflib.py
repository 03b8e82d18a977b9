"""The virtual vehicle on its port, with cflib as its client."""

import threading

import pytest
from cflib.crazyflie.mem import MemoryElement, Poly4D
from cflib.crtp.udpdriver import UdpDriver
from cflib.utils.power_switch import PowerSwitch
from virtual_client import LIMIT, Client, connected_vehicle

from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.firmware.supervisor import State
from crazyflie_virtual.firmware_parameters import parameter_specs
from crazyflie_virtual.log import log_variables
from crazyflie_virtual.settings import FIRST_PORT


@pytest.fixture(scope="module")
def connected():
    """Return a vehicle and a client for all tests that do not fly: connections take time."""
    with connected_vehicle() as vehicle_and_client:
        yield vehicle_and_client


def elements(toc):
    return {f"{group}.{name}" for group, names in toc.toc.items() for name in names}


def test_scan(serve):
    for port in range(FIRST_PORT, FIRST_PORT + 10):
        try:
            _, uri = serve(port=port)
        except OSError:
            continue
        break
    else:
        pytest.skip("all ports that cflib scans are taken")
    assert [uri, ""] in UdpDriver().scan_interface()


def test_tables_values_and_memories_arrive(connected):
    _, client = connected
    cf = client.cf
    assert cf.platform.get_protocol_version() == 12
    assert elements(cf.log.toc) == {f"{v.group}.{v.name}" for v in log_variables()}
    assert elements(cf.param.toc) == {f"{p.group}.{p.name}" for p in parameter_specs()}
    assert float(cf.param.get_value("posCtlPid.thrustBase")) == 36000
    assert cf.param.toc.get_element("pm", "lowVoltage").is_persistent()
    sizes = {m.type: m.size for m in cf.mem.mems}
    assert (sizes[0x00], sizes[0x12], sizes[0x15]) == (8191, 4096, 4096)
    wait_until(lambda: "up and running" in client.text)


def test_tables_are_cached(serve, tmp_path):
    server, uri = serve()
    counts = []
    for _ in range(2):
        client = Client(uri, cache=str(tmp_path))
        before = server.vehicle.board.firmware.link_statistics.received
        client.open().wait_for("fully_connected")
        counts.append(server.vehicle.board.firmware.link_statistics.received - before)
        assert elements(client.cf.log.toc) == {f"{v.group}.{v.name}" for v in log_variables()}
        client.close()
    assert counts[0] - counts[1] > len(log_variables())


def test_log_block_comes_every_ten_milliseconds(connected):
    _, client = connected
    rows = client.log("stateEstimate.z", "acc.z", "pm.vbat", "stateEstimateZ.quat")
    wait_until(lambda: len(rows) >= 100)
    stamps = [stamp for stamp, _ in rows[:100]]
    assert [b - a for a, b in zip(stamps, stamps[1:], strict=False)] == [10] * 99
    values = rows[-1][1]
    assert values["acc.z"] == pytest.approx(1.0, abs=0.02)
    assert values["pm.vbat"] == pytest.approx(4.18, abs=0.05)


def test_parameters(connected):
    vehicle, client = connected
    client.set("posCtlPid.xKp", 1.5)
    assert vehicle.board.firmware.stabilizer.position.x.kp == 1.5
    answers = []
    param = client.cf.param
    param.get_default_value("posCtlPid.xKp", lambda *a: answers.append(a))
    wait_until(lambda: answers)
    param.persistent_store("posCtlPid.xKp", lambda *a: answers.append(a))
    wait_until(lambda: len(answers) == 2)
    param.persistent_get_state("posCtlPid.xKp", lambda *a: answers.append(a))
    wait_until(lambda: len(answers) == 3)
    assert answers[0] == ("posCtlPid.xKp", 2.0)
    assert answers[1] == ("posCtlPid.xKp", True)
    assert tuple(answers[2][1]) == (True, 2.0, 1.5)


def test_memories(connected):
    vehicle, client = connected
    (trajectory,) = client.cf.mem.get_mems(MemoryElement.TYPE_TRAJ)
    pieces = [Poly4D(1.0 + k, *(Poly4D.Poly([k + 0.5] * 8) for _ in range(4))) for k in range(31)]
    trajectory.trajectory = pieces
    done = threading.Event()
    trajectory.write_data(lambda *_: done.set())
    assert done.wait(LIMIT)
    content = b"".join(bytes(piece.pack()) for piece in pieces)
    assert bytes(vehicle.board.firmware.planner.memory[: len(content)]) == content


def test_hover_with_the_high_level_commander(connect):
    vehicle, client = connect()
    rows = client.log("stateEstimate.z", "supervisor.info")
    client.cf.high_level_commander.takeoff(0.4, 1.0)
    wait_until(lambda: vehicle.physics.position[2] > 0.37)
    client.cf.high_level_commander.go_to(0.2, 0.0, 0.4, 0.0, 1.0)
    wait_until(lambda: vehicle.physics.position[0] > 0.18)
    assert rows[-1][1]["stateEstimate.z"] == pytest.approx(vehicle.physics.position[2], abs=0.05)
    assert "Is flying" in client.cf.supervisor.read_state_list()
    client.cf.high_level_commander.land(0.0, 1.0)
    wait_until(lambda: vehicle.physics.position[2] == 0.0)
    wait_until(lambda: not any(vehicle.board.firmware.stabilizer.commands))


def test_streamed_attitude_flies_forward(connect):
    vehicle, client = connect()
    client.cf.commander.send_setpoint(0.0, 0.0, 0.0, 0)

    def ahead():
        # Positive pitch is forward for the user of cflib.
        client.cf.commander.send_setpoint(0.0, 8.0, 0.0, 48000)
        return vehicle.physics.velocity[0] > 0.2

    wait_until(ahead)
    assert vehicle.physics.position[2] > 0.0
    assert abs(vehicle.physics.velocity[1]) < 0.1


def test_external_pose_reaches_the_estimate(connect):
    _, client = connect(positioning="none")
    rows = client.log("stateEstimate.x", "stateEstimate.yaw", "locSrv.z")

    def arrived():
        client.cf.extpos.send_extpose(1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8)
        return rows and rows[-1][1]["stateEstimate.x"] > 0.9

    wait_until(arrived)
    wait_until(lambda: arrived() and rows[-1][1]["stateEstimate.yaw"] > 70.0)
    assert rows[-1][1]["locSrv.z"] == 3.0


def is_acknowledged(command):
    """Tell whether a command was answered within the 0.1 s that cflib waits."""
    try:
        command()
    except Exception:
        # cflib raises Exception itself.
        return False
    return True


def test_emergency_stop_and_power_cycle(connect):
    vehicle, client = connect()
    client.cf.high_level_commander.takeoff(0.3, 0.5)
    wait_until(lambda: vehicle.physics.position[2] > 0.1)
    client.cf.supervisor.send_emergency_stop()
    wait_until(lambda: not any(vehicle.board.firmware.stabilizer.commands))
    wait_until(lambda: "Is locked" in client.cf.supervisor.read_state_list())
    before = vehicle.board
    switch = PowerSwitch(client.uri)
    wait_until(lambda: is_acknowledged(switch.stm_power_down))
    wait_until(lambda: vehicle.board is None)
    wait_until(lambda: is_acknowledged(switch.stm_power_up))
    switch.close()
    wait_until(lambda: vehicle.board not in (None, before))
    wait_until(lambda: vehicle.board.firmware.supervisor.state is State.READY_TO_FLY)


def test_arming(connect):
    vehicle, client = connect(auto_arm=False)
    supervisor = client.cf.supervisor
    assert supervisor.can_be_armed
    assert not supervisor.is_armed
    supervisor.send_arming_request(True)
    wait_until(lambda: vehicle.board.firmware.supervisor.state is State.READY_TO_FLY)
    wait_until(lambda: supervisor.is_armed)


def test_pings_are_echoed(connected):
    _, client = connected
    delays = []
    client.cf.link_statistics.latency_updated.add_callback(delays.append)
    wait_until(lambda: len(delays) >= 3)
