#!/usr/bin/env python
"""Takeoff, a short flight and landing by cmd_hover; needs a flow deck, or an external position.

Usage: Hover.py [PREFIX ...], one for each vehicle; by default crazyflie. The script uses plain
rospy, like your own: copy it, and change `fly`.
"""

import math
import sys
import threading

import rospy
from std_msgs.msg import Empty

from crazyflie_driver.msg import Hover

SPEED = 0.2  #: Speed of all moves (m/s).
RATE = 20.0  #: Setpoints a second; the firmware gives up after 0.5 s without one.
END_LIMIT = 10.0  #: Longest time for landings when ROS shuts down (s).

is_ending = threading.Event()  #: Set when ROS shuts down: at Ctrl-C, for instance.


class Crazyflie:
    """A vehicle that flies by velocities and a height.

    Every method blocks until the vehicle should have arrived, and repeats its setpoints meanwhile.
    The vehicle falls if the next method does not follow at once. After `is_ending` all but `land`
    raise ROSInterruptException.

    The constructor waits until the driver subscribes below the prefix.
    """

    def __init__(self, prefix: str):
        self._rate = rospy.Rate(RATE)
        self._height = 0.0
        self._is_landing = False
        self._setpoints = rospy.Publisher(f"{prefix}/cmd_hover", Hover, queue_size=1)
        self._stops = rospy.Publisher(f"{prefix}/cmd_stop", Empty, queue_size=1)
        while not (self._setpoints.get_num_connections() and self._stops.get_num_connections()):
            self._sleep()

    def goTo(self, x: float, y: float, zDistance: float, yaw: float) -> None:  # noqa: N802, N803
        """Fly straight to a point at `SPEED`, keeping the heading; the yaw is not used.

        The point is x ahead and y to the left of the vehicle, at a height above the surface below,
        m.
        """
        start, climb = self._height, zDistance - self._height
        count = math.ceil(math.hypot(x, y, climb) / SPEED * RATE)
        for k in range(1, count + 1):
            self._height = start + climb * k / count
            self._send(x * RATE / count, y * RATE / count)

    def takeOff(self, zDistance: float) -> None:  # noqa: N802, N803
        """Climb to a height, m."""
        self.goTo(0.0, 0.0, zDistance, 0.0)

    def land(self) -> None:
        """Sink to the ground and stop the motors."""
        self._is_landing = True
        self.goTo(0.0, 0.0, 0.0, 0.0)
        # The vehicle lags behind its setpoints.
        self.hold(0.5)
        self._stops.publish(Empty())

    def hold(self, seconds: float) -> None:
        """Stay for a while, s."""
        for _ in range(math.ceil(seconds * RATE)):
            self._send(0.0, 0.0)

    def _send(self, vx, vy):
        setpoint = Hover(vx=vx, vy=vy, yawrate=0.0, zDistance=self._height)
        setpoint.header.stamp = rospy.Time.now()
        self._setpoints.publish(setpoint)
        self._sleep()

    def _sleep(self):
        if is_ending.is_set() and not self._is_landing:
            raise rospy.ROSInterruptException("ROS shuts down")
        self._rate.sleep()


def fly(prefix: str) -> None:
    """Fly one vehicle up, ahead and to the left, and down."""
    vehicle = Crazyflie(prefix)
    try:
        vehicle.takeOff(0.4)
        vehicle.hold(1.0)
        vehicle.goTo(0.4, 0.2, 0.3, 0.0)
        vehicle.hold(1.0)
    finally:
        vehicle.land()


def end(threads: list[threading.Thread]) -> None:
    """Have all vehicles land; called when ROS shuts down, while topics still work."""
    is_ending.set()
    for thread in threads:
        thread.join(END_LIMIT)
    # The last message may still be in transit.
    rospy.sleep(0.2)


if __name__ == "__main__":
    rospy.init_node("hover", anonymous=True)
    threads = [
        threading.Thread(target=fly, args=(prefix,))
        for prefix in rospy.myargv(sys.argv)[1:] or ["crazyflie"]
    ]
    for thread in threads:
        thread.start()
    rospy.on_shutdown(lambda: end(threads))
    for thread in threads:
        thread.join()
