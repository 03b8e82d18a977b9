"""Parameters that several demos have."""

from crazyflie_controller.pose_source import WorldFrameParameters
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC, Integer, Number

AXIS = Integer(0, 255)  #: Number of a joystick's axis.
RATE = Number("Hz", above=0.0, maximum=500.0)  #: How often something is published.


class JoyParameters(Parameters):
    """Of nodes that follow a joystick."""

    joy_topic: str = parameter(TOPIC, "where the joystick's messages come from", "joy")


class SetpointParameters(Parameters):
    """Of nodes that publish cmd_vel."""

    rate: float = parameter(RATE, "setpoints a second", 50.0)


class GoalParameters(WorldFrameParameters):
    """Of nodes that publish goals."""

    rate: float = parameter(RATE, "goals a second", 30.0)
