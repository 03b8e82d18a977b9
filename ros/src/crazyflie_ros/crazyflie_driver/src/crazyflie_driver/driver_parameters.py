"""Parameters of the driver, and of each vehicle: as parameters and as fields of AddCrazyflie."""

import string
from collections.abc import Callable
from typing import Any, Self

import rosgraph.names
from typing_extensions import override

from crazyflie_driver.msg import LogBlock
from crazyflie_driver.positioning import ESTIMATOR, KALMAN, MOCAP, SOURCES
from crazyflie_driver.srv import AddCrazyflieRequest
from crazyflie_link.limits import (
    LONGEST_PERIOD_MS,
    MIN_DURATION,
    REPEAT_PERIOD,
    REPEATS,
    SHORTEST_PERIOD_MS,
)
from crazyflie_utils import ParameterError, Parameters, ServiceError, parameter, topic
from crazyflie_utils.parameters.declaration import REQUIRED, Declaration, group, read_parameter
from crazyflie_utils.parameters.types import (
    BOOLEAN,
    FRAME,
    SHARE,
    TEXT,
    Converted,
    Integer,
    ListOf,
    Number,
    Text,
)

_VOLTS = Number("V", minimum=0.0)
_SECONDS = Number("s", minimum=0.0)


ADD, REMOVE = "/add_crazyflie", "/remove_crazyflie"  #: Services of the server.


class LinkLimits(Parameters):
    """Limits of a link, beyond which the diagnostics warn."""

    min_quality: float = parameter(SHARE, "with less of the pings answered they warn", 0.8)
    max_latency: float | None = parameter(
        Number("s", above=0.0), "with more they warn; without it they do not", None
    )
    min_unicast_rate: float = parameter(
        SHARE,
        "with less of the packets of a second received by the vehicle, as its log says, they warn",
        0.0,
    )
    min_broadcast_rate: float = parameter(SHARE, "the same of broadcast packets", 0.0)


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


class CrazyflieServerParameters(Parameters):
    """Parameters of `CrazyflieServerNode`."""

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
    emergency_topic: str = topic(
        "emergency", "std_msgs/Empty, stops the motors of all vehicles, for good", "/all/emergency"
    )
    link: LinkLimits = group(LinkLimits, "link")
    broadcast: BroadcastParameters = group(BroadcastParameters, "broadcast")


STATUS_TOPIC = "status"  #: Topic with the state of a vehicle in words.
#: The same with more details, as crazyflie_msgs/VehicleStatus.
VEHICLE_STATUS_TOPIC = "vehicle_status"
#: Topic with the reason why its own estimate cannot be used for flight.
POSITIONING_TOPIC = "positioning"
CONNECTED_TOPIC = "connected"  #: Topic with whether the driver is connected to a vehicle.


#: Parameter below a vehicle's namespace that the driver reads when the vehicle is added.
POSITIONING_PARAMETER = "positioning"


UNCHANGED, KALMAN_FILTER = "unchanged", "kalman"  #: Values of ``estimator``.


def _namespace(value):
    """Return a name, empty for the root, without slashes and white space around it."""
    name = value.strip(f"/{string.whitespace}") if isinstance(value, str) else None
    if name is None or not rosgraph.names.is_legal_name("/" + name):
        raise ValueError
    return name


def _log_topic(value):
    name = _namespace(value)
    if not name:
        raise ValueError
    if name in _OWN_TOPICS:
        raise ValueError(f"the driver itself has a topic {name!r}")
    return name


_NAMESPACE = Converted(
    _namespace, "the name of a namespace, such as crazyflie1, or nothing for the root"
)
_TOPICS = ListOf(Converted(_log_topic, "the name of a topic, such as motors"))
_VARIABLES = ListOf(TEXT)
_ALL_VARIABLES = ListOf(_VARIABLES)

_VARIABLES_NAME = "genericLogTopic_NAME_Variables"

#: Parameter -> field of LogBlock in which a request has it.
_LOG_BLOCK_FIELDS = {
    "genericLogTopics": "topic_name",
    "genericLogTopicFrequencies": "frequency",
    _VARIABLES_NAME: "variables",
}


class VehicleParameters(Parameters):
    """How a vehicle is connected, and what is published of it.

    Fields have the names that they have in a crazyflie_driver/AddCrazyflieRequest,
    except for those of `log_blocks`.
    """

    uri: str = parameter(
        TEXT, "`radio://DONGLE/CHANNEL/RATE/ADDRESS`, `udp://HOST:PORT` or `usb://NUMBER`"
    )
    tf_prefix: str = parameter(
        _NAMESPACE, "namespace of the vehicle's topics, services and parameters", ""
    )
    roll_trim: float = parameter(Number("degrees"), "added to cmd_vel", 0.0)
    pitch_trim: float = parameter(Number("degrees"), "added to cmd_vel", 0.0)
    enable_parameters: bool = parameter(BOOLEAN, "firmware parameters as ROS parameters", True)
    use_ros_time: bool = parameter(
        BOOLEAN, "stamps are ROS time, or else the time since the vehicle was switched on", True
    )
    enable_logging: bool = parameter(BOOLEAN, "publish log data at all, except rssi", True)
    enable_logging_imu: bool = parameter(BOOLEAN, "publish this standard topic", True)
    enable_logging_temperature: bool = parameter(BOOLEAN, "publish this standard topic", True)
    enable_logging_magnetic_field: bool = parameter(BOOLEAN, "publish this standard topic", True)
    enable_logging_pressure: bool = parameter(BOOLEAN, "publish this standard topic", True)
    enable_logging_battery: bool = parameter(BOOLEAN, "publish this standard topic", True)
    enable_logging_packets: bool = parameter(BOOLEAN, "publish this standard topic", True)
    enable_logging_pose: bool = parameter(BOOLEAN, "publish this standard topic", False)
    log_topics: tuple[str, ...] = parameter(
        _TOPICS, "topics of custom log blocks, below the prefix", (), "genericLogTopics"
    )
    log_periods: tuple[int, ...] = parameter(
        ListOf(Integer(SHORTEST_PERIOD_MS, LONGEST_PERIOD_MS, "ms")),
        "periods of these log blocks, in spite of the name",
        (),
        "genericLogTopicFrequencies",
    )
    log_variables: tuple[tuple[str, ...], ...] = parameter(
        # On the parameter server, each log block has a parameter.
        Converted(_ALL_VARIABLES, str(_ALL_VARIABLES), _VARIABLES.label),
        "for each NAME in genericLogTopics: its variables",
        name=_VARIABLES_NAME,
    )

    positioning: str = parameter(
        Text(SOURCES),
        "source of the pose: motion capture, or the vehicle's own estimate by its Lighthouse, "
        "Flow or Loco deck, which the driver then publishes on /tf as `PREFIX/estimate`",
        MOCAP,
    )

    @override
    def complaints(self) -> list[str]:
        found = [
            f"two log blocks are called {name!r}"
            for name in sorted(set(self.log_topics))
            if self.log_topics.count(name) > 1
        ]
        if len(self.log_topics) != len(self.log_periods):
            found.append(
                f"genericLogTopicFrequencies has {len(self.log_periods)} entries, "
                f"genericLogTopics {len(self.log_topics)}; expected as many"
            )
        return found

    @property
    def prefix(self) -> str:
        """Absolute namespace of the vehicle, such as /crazyflie1; empty for the root."""
        return f"/{self.tf_prefix}" if self.tf_prefix else ""

    @property
    def name(self) -> str:
        """Name of the vehicle in messages."""
        return self.tf_prefix or self.uri

    @property
    def frame(self) -> str:
        """Frame of the vehicle's sensors."""
        return f"{self.tf_prefix}/base_link".lstrip("/")

    @property
    def topics(self) -> frozenset[str]:
        """Standard topics that are chosen."""
        return frozenset(
            name
            for name in STANDARD_TOPICS
            if (self.enable_logging or name == "packets") and getattr(self, _SWITCH + name)
        )

    @property
    def is_own_estimate(self) -> bool:
        """Whether the vehicle is flown by its own estimate."""
        return self.positioning != MOCAP

    @property
    def estimate_frame(self) -> str:
        """Frame of the vehicle's own estimate on /tf."""
        return f"{self.tf_prefix}/estimate".lstrip("/")

    @property
    def log_blocks(self) -> list[LogBlock]:
        """Custom log blocks; the field ``frequency`` is a period in ms."""
        columns = (self.log_topics, self.log_periods, map(list, self.log_variables))
        return [LogBlock(*row) for row in zip(*columns, strict=True)]

    def request(self) -> AddCrazyflieRequest:
        """Return the request that has the server add the vehicle."""
        return AddCrazyflieRequest(*(getattr(self, n) for n in AddCrazyflieRequest.__slots__))

    @classmethod
    def from_request(cls, request: AddCrazyflieRequest) -> Self:
        """Return the parameters of a request; `ServiceError` names all that makes no sense.

        The request has no ``positioning``: its type is that of other drivers, too.
        """
        values = {name: getattr(request, name) for name in request.__slots__}
        values["uri"] = request.uri.strip()
        for name, field in _LOG_BLOCK_FIELDS.items():
            values[name] = [getattr(block, field) for block in request.log_blocks]
        names = {name: f"log_blocks/{field}" for name, field in _LOG_BLOCK_FIELDS.items()}
        try:
            return cls.read(values.__getitem__, lambda name: names.get(name, name))
        except ParameterError as error:
            raise ServiceError("; ".join(error.complaints)) from None


_SWITCH = "enable_logging_"

#: Topics that are switched by ``enable_logging_NAME``.
STANDARD_TOPICS = tuple(
    declaration.name.removeprefix(_SWITCH)
    for declaration in VehicleParameters.declarations()
    if declaration.name.startswith(_SWITCH)
)

#: Topics of setpoints and of measured positions, to which the driver subscribes.
INPUT_TOPICS = (
    "cmd_vel",
    "cmd_stop",
    "cmd_full_state",
    "cmd_velocity_world",
    "cmd_hover",
    "cmd_position",
    "external_position",
    "external_pose",
)

_OWN_TOPICS = (
    *STANDARD_TOPICS,
    *INPUT_TOPICS,
    "rssi",
    "heading",
    STATUS_TOPIC,
    VEHICLE_STATUS_TOPIC,
    CONNECTED_TOPIC,
    POSITIONING_TOPIC,
)


class CrazyflieAddParameters(VehicleParameters):
    """The same on the parameter server, where the variables of each log block are a parameter.

    What is not in an AddCrazyflieRequest is written to the vehicle after it has been added.
    """

    estimator: str = parameter(
        Text((UNCHANGED, KALMAN_FILTER)),
        f"`{KALMAN_FILTER}` sets the firmware's `{ESTIMATOR}` to {KALMAN}: for vehicles that fly "
        "by their own position, from external poses or a deck. Without either its attitude drifts",
        UNCHANGED,
    )

    @classmethod
    @override
    def read(cls, get: Callable[[str], Any], full_name: Callable[[str], str] = str) -> Self:
        def get_or_collect(name: str) -> Any:
            if name != _VARIABLES_NAME:
                return get(name)
            try:
                topics = _TOPICS(get("genericLogTopics"))
            except (KeyError, ValueError):
                return ()
            names = [_VARIABLES_NAME.replace("NAME", topic) for topic in topics]
            declarations = [Declaration(n, _VARIABLES, "", REQUIRED, live=False) for n in names]
            return [read_parameter(each, get, full_name) for each in declarations]

        return super().read(get_or_collect, full_name)
