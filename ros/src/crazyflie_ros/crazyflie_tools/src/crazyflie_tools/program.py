"""Common parts of all tools: arguments, a time limit, exit statuses, messages."""

import argparse
import os
import sys
import threading
from collections.abc import Callable
from typing import Any

from crazyflie_link.address import DEFAULT_ADDRESS, Address
from crazyflie_link.errors import AddressError, CrazyflieError
from crazyflie_utils.parameters.types import POSITIVE

FINE, FAILED = 0, 1  #: Exit statuses; argparse's own for wrong usage is 2.
DEFAULT_URI = f"radio://0/80/2M/{DEFAULT_ADDRESS}"  #: Address of a new vehicle.
LIMIT = 40.0  #: Timeout (s), longer than that of a connection.


def argument(parse: Callable[[str], Any], expected: str = "") -> Callable[[str], Any]:
    """Return the type of an argument, from a function that raises ValueError or `AddressError`.

    The message says what was expected; by default it is that of the error.
    """

    def convert(text):
        try:
            return parse(text)
        except (ValueError, AddressError) as error:
            reason = f"{text!r}: expected {expected}" if expected else str(error)
            raise argparse.ArgumentTypeError(reason) from None

    return convert


#: Type of a time, s.
SECONDS = argument(POSITIVE, "a number of seconds above 0")


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
            type=argument(Address.parse),
            default=DEFAULT_URI,
            help="address of the vehicle: radio://DONGLE/CHANNEL/RATE/ADDRESS or udp://HOST:PORT; "
            "by default %(default)s",
        )
    if has_timeout:
        parser.add_argument(
            "--timeout",
            type=SECONDS,
            default=LIMIT,
            metavar="SECONDS",
            help="time limit; by default %(default)g",
        )
    return parser


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
