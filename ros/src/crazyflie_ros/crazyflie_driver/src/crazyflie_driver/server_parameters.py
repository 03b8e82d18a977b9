"""Parameters of the driver."""

from crazyflie_link.broadcast import REPEAT_PERIOD, REPEATS
from crazyflie_link.subsystem import MIN_DURATION
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, TOPIC, Integer, Number

_VOLTS = Number("V", minimum=0.0)
_SECONDS = Number("s", minimum=0.0)
_SHARE = Number("", minimum=0.0, maximum=1.0)


class SafetyParameters(Parameters):
    """Reactions of the driver to faults."""

    emergency_watchdog: bool = parameter(
        BOOLEAN,
        "feed the firmware's emergency-stop watchdog from the first high-level command on: 1 s "
        "after PC or link have died the vehicle falls, and is locked until it is restarted; so "
        "it is after it has been removed",
        False,
    )
    battery_low: float = parameter(
        _VOLTS, "below it the diagnostics warn and takeoff is refused", 3.2, "battery/low"
    )
    battery_critical: float = parameter(
        _VOLTS,
        "below it a flight is landed, on high-level commands or on setpoints other than cmd_vel",
        3.0,
        "battery/critical",
    )
    battery_critical_time: float = parameter(
        _SECONDS, "after so long, since the voltage sinks under load", 5.0, "battery/critical_time"
    )
    landing_duration: float = parameter(
        Number("s", minimum=MIN_DURATION, maximum=30.0),
        "of landings that the driver itself begins, at least; longer where 0.5 m/s need more",
        3.0,
        "landing/duration",
    )
    landing_limit: float = parameter(
        _SECONDS, "how long the removal of a vehicle waits for one", 10.0, "landing/limit"
    )


class LinkLimits(Parameters):
    """Limits of a link, beyond which the diagnostics warn."""

    min_quality: float = parameter(_SHARE, "with less of the pings answered they warn", 0.8)
    max_latency: float | None = parameter(
        Number("s", above=0.0), "with more they warn; without it they do not", None
    )
    min_unicast_rate: float = parameter(
        _SHARE,
        "with less of the packets of a second received by the vehicle, as its log says, they warn",
        0.0,
    )
    min_broadcast_rate: float = parameter(_SHARE, "the same of broadcast packets", 0.0)


class BroadcastParameters(Parameters):
    """How broadcasts are sent."""

    repeats: int = parameter(Integer(1, 100), "how often a command is broadcast", REPEATS)
    repeat_period: float = parameter(
        Number("s", minimum=0.0, maximum=0.1), "from one time to the next", REPEAT_PERIOD
    )
    poses: int = parameter(
        Integer(0, 255),
        "from so many vehicles on one radio channel on, their external positions and poses are "
        "packed (to 1 mm and about 0.2 degrees) and broadcast; 0 for never",
        5,
    )


class CrazyflieServerParameters(SafetyParameters):
    """Parameters of `CrazyflieServerNode`."""

    fixed_frame: str = parameter(
        FRAME, "frame of the pose that vehicles estimate", "world", "frames/fixed"
    )
    connect_limit: float = parameter(
        Number("s", minimum=0.0, maximum=45.0),
        "how long it is tried to connect to a vehicle that does not answer, such as one that is "
        "switched on or launched together with the driver",
        15.0,
        "connect/limit",
    )
    emergency_topic: str = parameter(
        TOPIC,
        "std_msgs/Empty, stops the motors of all vehicles, for good",
        "/all/emergency",
        "topics/emergency",
    )
    link: LinkLimits = group(LinkLimits, "link")
    broadcast: BroadcastParameters = group(BroadcastParameters, "broadcast")
