"""Link to a Crazyflie: connections with limits, log blocks, parameters, commands.

The names below are imported at their first use: `crazyflie_link.errors`, `crazyflie_link.address`
and the like do not need the rest, nor cflib.
"""

import contextlib
import importlib
import warnings

# cflib switches deprecation warnings on for the whole process, and rospy has some.
with warnings.catch_warnings(), contextlib.suppress(ImportError):
    import cflib  # noqa: F401

_HOME = {
    "Crazyflie": "crazyflie_link.crazyflie",
    "CrazyflieError": "crazyflie_link.errors",
    "LinkState": "crazyflie_link.crazyflie",
    "LogBlock": "crazyflie_link.log",
    "scan": "crazyflie_link.crazyflie",
}

__all__ = ["Crazyflie", "CrazyflieError", "LinkState", "LogBlock", "scan"]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
