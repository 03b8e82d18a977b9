"""Can be imported, as many scripts do without using it; what it offered is not here."""

from typing import NoReturn


def __getattr__(name: str) -> NoReturn:
    raise AttributeError(
        f"pycrazyswarm.cfsim.cffirmware has no {name}: the firmware's C code is not part of this "
        "workspace; expected functions of pycrazyswarm.util or uav_trajectory in its place"
    )
