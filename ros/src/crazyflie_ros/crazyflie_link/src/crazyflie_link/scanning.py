"""Search for vehicles within reach."""

import contextlib
import io

import cflib.crtp
from cflib.crtp.radiodriver import DEFAULT_ADDR

from crazyflie_link.errors import AddressError, CrazyflieError, explain
from crazyflie_link.safe_crazyflie import init_drivers

DEFAULT_ADDRESS = f"{DEFAULT_ADDR:X}"  #: Radio address that vehicles have when they are new.


def scan(address: str = DEFAULT_ADDRESS) -> tuple[list[str], list[CrazyflieError]]:
    """Look for vehicles on all interfaces; takes some seconds with a radio.

    On UDP the ports 19850 to 19859 of 127.0.0.1, or of the environment variable SCAN_ADDRESS, are
    tried; by radio an address of up to 10 hexadecimal digits, or else `AddressError` is raised.

    Returns the addresses that were found, and an error for each interface that could not be
    searched, such as a missing Crazyradio.
    """
    try:
        number = int(address, 16)
    except ValueError:
        number = -1
    if not 0 <= number < 1 << 40:
        raise AddressError(f"{address!r} is no radio address: expected up to 10 hexadecimal digits")
    init_drivers()
    found: list[str] = []
    problems: list[CrazyflieError] = []
    for driver_class in cflib.crtp.CLASSES:
        # What stops the radio driver it prints, and finds nothing.
        printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(printed):
                found += [uri for uri, *_ in driver_class().scan_interface(number)]
        except Exception as error:
            printed.write(str(error) or repr(error))
        if printed.getvalue().strip():
            problems.append(explain(driver_class.__name__, printed.getvalue()))
    return found, problems
