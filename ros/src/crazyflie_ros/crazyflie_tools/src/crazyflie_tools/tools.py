"""The tools: each parses its arguments, by default the process's, and returns its exit status.

Modules that need cflib are imported when the arguments are valid, or where they depend on it.
"""

import math
import queue
import time

import numpy as np

import crazyflie_link
from crazyflie_link.address import DEFAULT_ADDRESS, radio_address
from crazyflie_link.errors import NoAnswerError
from crazyflie_tools.program import FINE, LIMIT, SECONDS, argument, make_parser, run
from crazyflie_utils.parameters.types import FIRMWARE_NUMBER

_CHECK_PERIOD = 0.1


def scan(arguments: list[str] | None = None) -> int:
    """List the vehicles within reach."""
    parser = make_parser(
        "scan",
        "List the addresses of the vehicles within reach: by radio on all channels and data rates, "
        "by USB, and on the UDP ports 19850 to 19859 of 127.0.0.1 or of the environment variable "
        "SCAN_ADDRESS.",
        has_uri=False,
    )
    parser.add_argument(
        "--address",
        type=argument(lambda text: f"{radio_address(text):X}"),
        default=DEFAULT_ADDRESS,
        help="radio address to call; by default %(default)s",
    )
    options = parser.parse_args(arguments)
    return run(parser.prog, lambda: _scan(options.address), options.timeout)


def _scan(address):
    found, problems = crazyflie_link.scan(address)
    print(*found, sep="\n", end="\n" if found else "")
    if not found:
        reasons = "".join(f"\n  {problem}" for problem in problems)
        raise NoAnswerError(
            f"no vehicle found by radio (address {address}), by USB or by UDP{reasons}"
        )


def list_params(arguments: list[str] | None = None) -> int:
    """List the parameters of a vehicle with their values."""
    parser = make_parser("listParams", "List the parameters of a vehicle: name, type, value.")
    return _talk(parser, arguments, _list_params)


def _list_params(vehicle, _):
    values = vehicle.parameters.values()
    for name, (c_type, is_writable) in vehicle.parameters.types().items():
        access = "" if is_writable else ", readonly"
        print(f"{name} ({_short(c_type)}{access}) {_text(values[name])}")


def list_log_variables(arguments: list[str] | None = None) -> int:
    """List the log variables of a vehicle."""
    parser = make_parser("listLogVariables", "List the log variables of a vehicle: name, type.")
    return _talk(parser, arguments, _list_log_variables)


def _list_log_variables(vehicle, _):
    for name, c_type in vehicle.log.variables().items():
        print(f"{name} ({_short(c_type)})")


def get_param(arguments: list[str] | None = None) -> int:
    """Print parameters of a vehicle."""
    parser = make_parser("getParam", "Print the values of parameters of a vehicle, one a line.")
    parser.add_argument(
        "name", nargs="+", type=_name, metavar="GROUP.NAME", help="such as ring.effect"
    )
    return _talk(parser, arguments, _get_param)


def _get_param(vehicle, options):
    print(*(_text(vehicle.parameters.read(name)) for name in options.name), sep="\n")


def set_param(arguments: list[str] | None = None) -> int:
    """Set a parameter of a vehicle."""
    parser = make_parser("setParam", "Set a parameter of a vehicle, and print the confirmed value.")
    parser.add_argument("name", type=_name, metavar="GROUP.NAME", help="such as ring.effect")
    parser.add_argument(
        "value",
        type=argument(FIRMWARE_NUMBER, "a finite number"),
        metavar="VALUE",
        help="a number; one like -1e-3 only after --",
    )
    return _talk(parser, arguments, _set_param)


def _set_param(vehicle, options):
    print(_text(vehicle.parameters.write(options.name, options.value)))


def reboot(arguments: list[str] | None = None) -> int:
    """Restart a vehicle, or switch it off."""
    from crazyflie_link.crazyflie import MODES

    parser = make_parser("reboot", "Restart a vehicle, or switch it off; only by radio.")
    parser.add_argument(
        "--mode",
        choices=MODES,
        default="firmware",
        help="restart into the firmware (default) or the boot loader; switch the main processor "
        "and the decks off or on; switch everything off",
    )
    options = parser.parse_args(arguments)
    vehicle = crazyflie_link.Crazyflie(options.uri.uri)
    return run(parser.prog, lambda: vehicle.reboot(options.mode), options.timeout)


def console(arguments: list[str] | None = None) -> int:
    """Print the console of a vehicle's firmware."""
    parser = make_parser("console", "Print the console of a vehicle's firmware.", has_timeout=False)
    parser.add_argument(
        "--duration",
        type=SECONDS,
        default=math.inf,
        metavar="SECONDS",
        help="time after which to end; by default at Ctrl-C",
    )
    options = parser.parse_args(arguments)
    limit = LIMIT + options.duration if math.isfinite(options.duration) else None
    return run(
        parser.prog, lambda: _console(options.uri.uri, options.duration), limit, interrupted=FINE
    )


def _console(uri, duration):
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    with crazyflie_link.Crazyflie(uri, on_console=lines.put) as vehicle:
        end = time.monotonic() + duration
        while time.monotonic() < end:
            try:
                print(lines.get(timeout=_CHECK_PERIOD), flush=True)
            except queue.Empty:
                # Raises the reason when the link is lost.
                vehicle.link()


def _talk(parser, arguments, work):
    """Connect, call ``work(vehicle, options)``, return the exit status."""
    options = parser.parse_args(arguments)

    def talk():
        with crazyflie_link.Crazyflie(options.uri.uri) as vehicle:
            work(vehicle, options)

    return run(parser.prog, talk, options.timeout)


def _name(text):
    # GROUP/NAME is what the driver's update_params and ROS call it.
    return text.strip("/").replace("/", ".")


def _short(c_type):
    return c_type.removesuffix("_t")


def _text(value):
    # The vehicle's numbers have 32 bits: 0.1, not 0.10000000149011612.
    return str(np.float32(value)) if isinstance(value, float) else str(value)
