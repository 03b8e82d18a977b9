"""Parameters of the node that offers the driver's high-level services."""

from crazyflie_msgs.msg import PositionVelocityStateStamped, PositionVelocityYawStateStamped
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, SERVICE, TIME_STEP, TOPIC

#: Namespace, below a vehicle's name, of the node; below /all of the same services for all.
HIGH_LEVEL = "high_level"

#: Nodes, one space between two, that begin what was uploaded to them as trajectory 0: vehicles that
#: are called one after the other do not begin together.
START_TOPIC = "/all/start_trajectory"


class HighLevelParameters(Parameters):
    """Parameters of `HighLevelNode`."""

    reference_topic: str = parameter(TOPIC, "references of the controller", "ref", "topics/ref")
    has_yaw: bool = parameter(
        BOOLEAN,
        "references are PositionVelocityYawStateStamped, and not PositionVelocityStateStamped",
        default=False,
        name="reference/yaw",
    )
    state_topic: str = parameter(TOPIC, "where the vehicle is", "state", "topics/state")
    flight_status_topic: str = parameter(
        TOPIC, "of the takeoff server", "in_flight_flight_status", "topics/flight_status"
    )
    flight_state_topic: str | None = parameter(
        TOPIC, "text of a takeoff server without flight status", None, "topics/flight_state"
    )
    takeoff: str = parameter(SERVICE, "the takeoff server's", "takeoff", "srv/takeoff")
    land: str = parameter(SERVICE, "the takeoff server's", "land", "srv/land")
    emergency: str = parameter(SERVICE, "stops the motors", "emergency", "srv/emergency")
    start_topic: str = parameter(
        TOPIC, "names those that begin trajectory 0 at once", START_TOPIC, "topics/start"
    )
    plan_topic: str = parameter(
        TOPIC, "what is flown until it has ended", "~plan/markers", "topics/plan"
    )
    fixed_frame: str = parameter(FRAME, "frame the references are in", "world", "frames/fixed")
    time_step: float = parameter(TIME_STEP, "from one reference to the next", 0.02)

    @property
    def reference_type(self) -> type[PositionVelocityStateStamped]:
        """Message type of references."""
        return PositionVelocityYawStateStamped if self.has_yaw else PositionVelocityStateStamped
