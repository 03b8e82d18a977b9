"""Names of vehicles."""

import itertools
import re
from collections.abc import Container

from crazyflie_utils.refusal import RefusalError

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def vehicle_name(wanted: str, taken: Container[str]) -> str:
    """Return the name that a vehicle gets.

    Parameters
    ----------
    wanted : str
        Of a namespace and a tf frame; empty for the first free one of crazyflie1, crazyflie2, ...
    taken : container of str

    Raises
    ------
    RefusalError
        It is no name, or another vehicle has it.
    """
    if not wanted:
        return next(name for k in itertools.count(1) if (name := f"crazyflie{k}") not in taken)
    if not _NAME.fullmatch(wanted):
        raise RefusalError(
            f"{wanted!r} is no name of a vehicle; expected letters, digits and underscores, the "
            "first a letter"
        )
    if wanted in taken:
        raise RefusalError(f"there is a vehicle {wanted} already")
    return wanted
