"""Missions of Crazyflies in Python, simulated, virtual and real."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from crazyflie_mission_api.fleet import Fleet

from crazyflie_mission_api.dry_run import DryRun
from crazyflie_mission_api.limits import Bounds, Limits, MissionError
from crazyflie_mission_api.minimum_snap import plan

__all__ = ["Bounds", "Fleet", "Limits", "MissionError", "DryRun", "plan"]


def __getattr__(name: str) -> object:
    # Planning needs no ROS, and must not import it.
    if name != "Fleet":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from crazyflie_mission_api.fleet import Fleet

    return Fleet
