"""Restarting a vehicle by radio."""

from collections.abc import Callable

from cflib.utils.power_switch import PowerSwitch

from crazyflie_link.address import Address
from crazyflie_link.errors import RefusedError, explain
from crazyflie_link.safe_crazyflie import init_drivers

#: What can be done -> cflib's name of it: restart into the firmware or the boot loader, switch the
#: main processor and the decks off or on again, switch everything off.
MODES = {
    "firmware": "reboot_to_fw",
    "bootloader": "reboot_to_bootloader",
    "sysoff": "stm_power_down",
    "syson": "stm_power_up",
    "alloff": "platform_power_down",
}


def reboot(
    address: Address, before: Callable[[], None] = lambda: None, mode: str = "firmware"
) -> None:
    """Restart a vehicle or switch it off, as one of `MODES`; only by radio; blocks.

    ``before()`` is called once it is clear that the link can do it. Raises `CrazyflieError` if it
    is not a radio link, or the vehicle has not acknowledged it.
    """
    if not address.is_radio:
        raise RefusedError(
            f"{address.uri}: only a radio link can restart a vehicle; switch it off and on instead"
        )
    before()
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
