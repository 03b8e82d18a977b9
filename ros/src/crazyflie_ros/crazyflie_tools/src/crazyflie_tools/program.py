"""What all tools share: arguments, a time limit, exit statuses, messages."""

import argparse
import math
import os
import sys
import threading
from collections.abc import Callable

from crazyflie_link.address import Address
from crazyflie_link.errors import AddressError, CrazyflieError

FINE, FAILED = 0, 1
"""Exit statuses; argparse's own for wrong usage is 2."""

DEFAULT_URI = "radio://0/80/2M/E7E7E7E7E7"
"""Address that a vehicle has when it is new."""

LIMIT = 40.0
"""When to give up, s: later than a connection does by itself."""


def make_parser(name: str, description: str) -> argparse.ArgumentParser:
    """Return a parser of a tool's arguments."""
    return argparse.ArgumentParser(
        prog=name,
        description=description,
        epilog="Exit status: 0 fine, 1 failed with a message on stderr, 2 wrong usage.",
    )


def add_uri(parser: argparse.ArgumentParser) -> None:
    """Add the argument ``--uri``, an `Address`."""
    parser.add_argument(
        "--uri",
        type=_address,
        default=DEFAULT_URI,
        help="address of the vehicle: radio://DONGLE/CHANNEL/RATE/ADDRESS or udp://HOST:PORT; "
        "by default %(default)s",
    )


def add_timeout(parser: argparse.ArgumentParser) -> None:
    """Add the argument ``--timeout``, s."""
    parser.add_argument(
        "--timeout",
        type=seconds,
        default=LIMIT,
        metavar="SECONDS",
        help="when to give up; by default %(default)g",
    )


def seconds(text: str) -> float:
    """Return the number of seconds, above 0, that a text stands for.

    Raises
    ------
    argparse.ArgumentTypeError
        It is none.
    """
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

    Parameters
    ----------
    name : str
        Of the tool; its messages begin with it.
    work : callable
        ``work()`` prints what was asked for, or raises `CrazyflieError`.
    limit : float or None
        Time limit, s. Work that does not end by then is left alone and the process
        ends on the spot: it may hang in the driver of a USB device.
    interrupted : int
        Exit status after Ctrl-C.
    """
    outcome: list[int] = []
    worker = threading.Thread(
        target=lambda: outcome.append(_attempt(name, work)), name=name, daemon=True
    )
    worker.start()
    try:
        worker.join(limit)
        if not worker.is_alive():
            # Nothing: a mistake in the tool, whose traceback is on stderr.
            return outcome[0] if outcome else FAILED
        status = FAILED
        _print_error(name, f"not done within {limit:g} s: gave up")
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
