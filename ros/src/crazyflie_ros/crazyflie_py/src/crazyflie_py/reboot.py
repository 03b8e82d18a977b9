"""Restarting a vehicle by radio."""

from collections.abc import Callable

from cflib.utils.power_switch import PowerSwitch

from crazyflie_py.address import Address
from crazyflie_py.backend import init_drivers
from crazyflie_py.errors import RefusedError, explain


def reboot(address: Address, before: Callable[[], None] = lambda: None) -> None:
    """Restart a vehicle's firmware, without a connection; only by radio. Blocks.

    Parameters
    ----------
    address : Address
    before : callable
        Called once it is clear that the link can do it.

    Raises
    ------
    CrazyflieError
        Not a radio link, or the vehicle has not acknowledged it.
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
            switch.reboot_to_fw()
        finally:
            switch.close()
    except Exception as error:
        # cflib raises bare exceptions.
        raise explain(address.uri, str(error)) from None
