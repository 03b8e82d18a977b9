"""Removes one vehicle from a simulation, and lets another one appear."""

import sys

import rospy

from crazyflie_tutorial_msgs.srv import RemoveVehicle, SpawnVehicle


def replace(remove, spawn, old: str, new: str, x: float, y: float) -> str:
    """Remove the vehicle ``old``, spawn ``new`` at (x, y), m; return the name of the new one.

    ``remove(name)`` and ``spawn(name, x, y)`` are the services. If there is no ``old``, which
    ``remove`` says with a rospy.ServiceException, the new one is spawned all the same.
    """
    raise NotImplementedError("step 3")


def main() -> None:
    """Replace crazyflie1 by rpr_crazyflie at (2, 1); exit with status 1 if that fails."""
    rospy.init_node("replace_vehicle")
    # Step 4: wait for the services remove (RemoveVehicle) and spawn (SpawnVehicle), 10 s at most,
    # call replace, and log the name. If anything fails (rospy.ROSException,
    # rospy.ServiceException), sys.exit with a text that says what.
    raise NotImplementedError("step 4")
