"""Vehicles without a connection: search for those within reach, restart one."""

import contextlib
import io

import cflib.crtp
from cflib.crtp.radiodriver import DEFAULT_ADDR
from cflib.utils.power_switch import PowerSwitch

from crazyflie_link.address import Address
from crazyflie_link.cflib_internals import init_drivers
from crazyflie_link.errors import AddressError, CrazyflieError, RefusedError, explain

DEFAULT_ADDRESS = f"{DEFAULT_ADDR:X}"  #: Radio address of new vehicles.


def scan(address: str = DEFAULT_ADDRESS) -> tuple[list[str], list[CrazyflieError]]:
    """Search for vehicles on all interfaces; takes some seconds with a radio.

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
        # The radio driver prints its errors, and finds nothing.
        printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(printed):
                found += [uri for uri, *_ in driver_class().scan_interface(number)]
        except Exception as error:
            printed.write(str(error) or repr(error))
        if printed.getvalue().strip():
            problems.append(explain(driver_class.__name__, printed.getvalue()))
    return found, problems


#: Mode -> cflib's name of it: restart into the firmware or the boot loader, switch the main
#: processor and the decks off or on again, switch everything off.
MODES = {
    "firmware": "reboot_to_fw",
    "bootloader": "reboot_to_bootloader",
    "sysoff": "stm_power_down",
    "syson": "stm_power_up",
    "alloff": "platform_power_down",
}


def check_is_radio(address: Address) -> None:
    """Raise `RefusedError` unless `reboot` can reach the vehicle: only by radio."""
    if not address.is_radio:
        raise RefusedError(
            f"{address.uri}: only a radio link can restart a vehicle; switch it off and on instead"
        )


def reboot(address: Address, mode: str = "firmware") -> None:
    """Restart a vehicle or switch it off, as one of `MODES`; only by radio; blocks.

    No link to the vehicle may be open. Raises `CrazyflieError` if it is not a radio link, or the
    vehicle has not acknowledged the command.
    """
    check_is_radio(address)
    init_drivers()
    try:
        switch = PowerSwitch(address.uri)
        try:
            getattr(switch, MODES[mode])()
        finally:
            switch.close()
    except Exception as error:
        # cflib raises bare exceptions.
        raise explain(address.uri, str(error)) from None
