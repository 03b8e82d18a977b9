"""Removes one vehicle from a simulation, and lets another one appear."""

import sys

import rospy

from crazyflie_tutorial_msgs.srv import RemoveVehicle, SpawnVehicle


def replace(remove, spawn, old: str, new: str, x: float, y: float) -> str:
    """Remove the vehicle ``old``, spawn ``new`` at (x, y), m; return the name of the new one.

    ``remove(name)`` and ``spawn(name, x, y)`` are the services. If there is no ``old``, which
    ``remove`` says with a rospy.ServiceException, the new one is spawned all the same.
    """
    try:
        remove(old)
    except rospy.ServiceException as error:
        rospy.logwarn(f"{old} is not removed: {error}")
    return spawn(new, x, y).name


def main() -> None:
    """Replace crazyflie1 by rpr_crazyflie at (2, 1); exit with status 1 if that fails."""
    rospy.init_node("replace_vehicle")
    try:
        for name in ("remove", "spawn"):
            rospy.wait_for_service(name, timeout=10.0)
        remove = rospy.ServiceProxy("remove", RemoveVehicle)
        spawn = rospy.ServiceProxy("spawn", SpawnVehicle)
        name = replace(remove, spawn, "crazyflie1", "rpr_crazyflie", 2.0, 1.0)
    except (rospy.ROSException, rospy.ServiceException) as error:
        sys.exit(f"no new vehicle: {error}")
    rospy.loginfo(f"{name} is there")
