"""Setpoints of Crazyswarm's API as messages of the driver."""

import math
import time
from typing import Any

from geometry_msgs.msg import Twist, Vector3
from std_msgs.msg import Empty

from crazyflie_driver.msg import FullState as FullStateMessage
from crazyflie_driver.msg import Hover as HoverMessage
from crazyflie_driver.msg import Position as PositionMessage
from crazyflie_driver.msg import VelocityWorld as VelocityWorldMessage
from crazyflie_fleet.conversions import full_state_message
from crazyflie_mission_api.ros_vehicle import RosVehicle
from crazyflie_model.polynomials import Goal
from crazyflie_py.setpoints import (
    Attitude,
    FullState,
    Hover,
    MotorsOff,
    Position,
    Setpoint,
    VelocityWorld,
)
from crazyflie_utils import NodeHandle
from crazyflie_utils.topics import Publisher

#: For the first setpoint, until the vehicle is connected, s of the machine's clock.
_CONNECTION_LIMIT = 2.0

_TOPICS: dict[type, tuple[str, Any]] = {
    FullState: ("cmd_full_state", FullStateMessage),
    Position: ("cmd_position", PositionMessage),
    VelocityWorld: ("cmd_velocity_world", VelocityWorldMessage),
    Hover: ("cmd_hover", HoverMessage),
    Attitude: ("cmd_vel", Twist),
    MotorsOff: ("cmd_stop", Empty),
}


class SetpointPublishers:
    """Publishes the setpoints of one vehicle."""

    def __init__(self, handle: NodeHandle, vehicle: RosVehicle):
        self._handle = handle
        self._vehicle = vehicle
        self._publishers: dict[type, Publisher] = {}

    def publish(self, setpoint: Setpoint) -> None:
        """Publish a setpoint; ValueError for one that the vehicle cannot follow."""
        if isinstance(setpoint, Attitude) and not self._vehicle.uses_driver:
            raise ValueError(
                f"{self._vehicle.name}: cmdVel cannot be followed: a controller of the workspace "
                "flies it; expected cmdPosition, cmdFullState, cmdVelocityWorld or cmdHover"
            )
        publisher = self._publishers.get(type(setpoint)) or self._connect(type(setpoint))
        publisher.publish(self._message(setpoint))

    def _connect(self, kind):
        name, message_type = _TOPICS[kind]
        top = self._vehicle.services["go_to"].rpartition("/")[0]
        publisher = self._publishers[kind] = self._handle.publisher(f"{top}/{name}", message_type)
        end = time.monotonic() + _CONNECTION_LIMIT
        while not publisher.has_subscribers() and time.monotonic() < end:
            time.sleep(0.01)
        return publisher

    def _message(self, setpoint):
        message = message_of(setpoint)
        if hasattr(message, "header"):
            message.header.stamp = self._handle.stamp()
        return message


def message_of(setpoint: Setpoint) -> Any:
    """Return the driver's message, without a stamp; its yaw rates are clockwise, in deg/s."""
    if isinstance(setpoint, FullState):
        goal = Goal(
            setpoint.position,
            setpoint.velocity,
            setpoint.acceleration,
            setpoint.yaw,
            setpoint.omega[2],
        )
        message = full_state_message(goal)
        message.twist.angular = Vector3(*setpoint.omega)
        return message
    if isinstance(setpoint, Position):
        x, y, z = setpoint.position
        return PositionMessage(x=x, y=y, z=z, yaw=math.degrees(setpoint.yaw))
    if isinstance(setpoint, VelocityWorld):
        return VelocityWorldMessage(vel=Vector3(*setpoint.velocity), yawRate=-setpoint.yaw_rate)
    if isinstance(setpoint, Hover):
        return HoverMessage(
            vx=setpoint.vx, vy=setpoint.vy, yawrate=-setpoint.yaw_rate, zDistance=setpoint.height
        )
    if isinstance(setpoint, Attitude):
        linear = Vector3(setpoint.pitch, setpoint.roll, setpoint.thrust)
        return Twist(linear, Vector3(0.0, 0.0, -setpoint.yaw_rate))
    return Empty()
