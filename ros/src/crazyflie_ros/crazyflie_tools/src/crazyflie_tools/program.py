"""Common parts of all tools: arguments, a time limit, exit statuses, messages."""

import argparse
import math
import os
import sys
import threading
from collections.abc import Callable

from crazyflie_link.address import DEFAULT_ADDRESS, Address
from crazyflie_link.errors import AddressError, CrazyflieError

FINE, FAILED = 0, 1  #: Exit statuses; argparse's own for wrong usage is 2.
DEFAULT_URI = f"radio://0/80/2M/{DEFAULT_ADDRESS}"  #: Address of a new vehicle.
LIMIT = 40.0  #: Timeout (s), longer than that of a connection.


def make_parser(
    name: str, description: str, has_uri: bool = True, has_timeout: bool = True
) -> argparse.ArgumentParser:
    """Return a parser, with the arguments ``--uri`` (an `Address`) and ``--timeout`` (s)."""
    parser = argparse.ArgumentParser(
        prog=name,
        description=description,
        epilog="Exit status: 0 fine, 1 failed with a message on stderr, 2 wrong usage.",
    )
    if has_uri:
        parser.add_argument(
            "--uri",
            type=_address,
            default=DEFAULT_URI,
            help="address of the vehicle: radio://DONGLE/CHANNEL/RATE/ADDRESS or udp://HOST:PORT; "
            "by default %(default)s",
        )
    if has_timeout:
        parser.add_argument(
            "--timeout",
            type=seconds,
            default=LIMIT,
            metavar="SECONDS",
            help="time limit; by default %(default)g",
        )
    return parser


def seconds(text: str) -> float:
    """Return a number of seconds above 0; raise `argparse.ArgumentTypeError` for another text."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number of seconds above 0")
    return value


def _address(text):
    try:
        return Address.parse(text)
    except AddressError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def run(name: str, work: Callable[[], None], limit: float | None, interrupted: int = FAILED) -> int:
    """Do the work of a tool and return its exit status.

    ``work()`` prints its result, or raises `CrazyflieError`. When it does not end within the limit
    (s) the process ends at once: it may hang in the driver of a USB device. After Ctrl-C the status
    is ``interrupted``.
    """
    outcome: list[int] = []
    worker = threading.Thread(
        target=lambda: outcome.append(_attempt(name, work)), name=name, daemon=True
    )
    worker.start()
    try:
        worker.join(limit)
        if not worker.is_alive():
            # No outcome means a bug of the tool, whose traceback is on stderr.
            return outcome[0] if outcome else FAILED
        status = FAILED
        _print_error(name, f"not done within {limit:g} s")
    except KeyboardInterrupt:
        status = interrupted
        if interrupted != FINE:
            _print_error(name, "interrupted")
    os._exit(status)


def _attempt(name, work):
    try:
        work()
        sys.stdout.flush()
    except CrazyflieError as error:
        _print_error(name, str(error))
        return FAILED
    except BrokenPipeError:
        # The reader has closed the pipe, and Python would still flush into it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return FINE


def _print_error(name, text):
    print(f"{name}: {text}", file=sys.stderr, flush=True)
