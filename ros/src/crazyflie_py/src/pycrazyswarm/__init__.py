"""Crazyswarm 1's names of `crazyflie_py`, which its scripts import as modules of this package."""

import sys
from types import ModuleType
from typing import NoReturn

import uav_trajectory

from crazyflie_py import Crazyswarm, crazyflie, crazyswarm_py, util

__all__ = ["Crazyswarm"]


def _missing(name: str) -> NoReturn:
    raise AttributeError(
        f"pycrazyswarm.cfsim.cffirmware has no {name}: the firmware's C code is not part of this "
        "workspace; expected functions of pycrazyswarm.util or uav_trajectory in its place"
    )


cfsim = ModuleType("pycrazyswarm.cfsim")
# Many scripts import the bindings of the firmware without using them.
cffirmware = ModuleType("pycrazyswarm.cfsim.cffirmware")
cffirmware.__getattr__ = _missing  # type: ignore[method-assign]
cfsim.cffirmware = cffirmware  # type: ignore[attr-defined]

crazyflieSim = crazyflie  # noqa: N816
crazyswarm = crazyswarm_py

for _name, _module in {
    "cfsim": cfsim,
    "cfsim.cffirmware": cffirmware,
    "crazyflie": crazyflie,
    "crazyflieSim": crazyflieSim,
    "crazyswarm": crazyswarm,
    "crazyswarm_py": crazyswarm_py,
    "uav_trajectory": uav_trajectory,
    "util": util,
}.items():
    sys.modules[f"{__name__}.{_name}"] = _module
