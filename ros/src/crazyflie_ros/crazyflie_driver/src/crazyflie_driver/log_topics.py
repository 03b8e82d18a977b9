"""Log data and application packets of a vehicle, as topics."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import genpy
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from sensor_msgs.msg import Imu, MagneticField, Temperature
from std_msgs.msg import Float32, Header, String

from crazyflie_driver.driver_parameters import POSITIONING_TOPIC
from crazyflie_driver.monitors import VARIANCES, VARIANCES_PERIOD_MS, BatteryMonitor, Variances
from crazyflie_driver.msg import GenericLogData, crtpPacket
from crazyflie_driver.positioning import (
    ESTIMATE,
    ESTIMATOR,
    PERIOD_MS,
    SYSTEMS,
    PoseAgreement,
    Positioning,
    check_deck,
    estimator_problem,
)
from crazyflie_driver.vehicle_base import BaseVehicle, ConnectionState, News
from crazyflie_link.errors import LinkLostError
from crazyflie_link.log import PERIOD_STEP_MS, LogBlock, quaternion_from_compressed
from crazyflie_model.supervisor import SupervisorState
from crazyflie_model.units import GRAVITY
from crazyflie_msgs.msg import VehicleStatus
from crazyflie_utils import ServiceError
from crazyflie_utils.topics import Publisher

_UNKNOWN = -1.0  #: First element of the covariance of a missing measurement (sensor_msgs/Imu).


class StandardTopic(NamedTuple):
    """A topic that every vehicle has; ``convert(header, values)`` returns its message.

    Its frame is the fixed one if it is in the world, or else the vehicle's.
    """

    name: str
    message_type: type[genpy.Message]
    variables: tuple[str, ...]
    convert: Callable[[Header, Sequence[float]], genpy.Message]
    in_world: bool = False


def _imu(header, values):
    message = Imu(header=header)
    message.orientation_covariance[0] = _UNKNOWN
    # The firmware measures in g and degrees/s.
    message.linear_acceleration = Vector3(*(GRAVITY * value for value in values[:3]))
    message.angular_velocity = Vector3(*map(math.radians, values[3:]))
    return message


def _pose(header, values):
    message = PoseStamped(header=header)
    message.pose.position = Point(*values[:3])
    message.pose.orientation = Quaternion(*quaternion_from_compressed(values[3]))
    return message


def _float(_, values):
    return Float32(values[0])


_IMU = StandardTopic("imu", Imu, ("acc.x", "acc.y", "acc.z", "gyro.x", "gyro.y", "gyro.z"), _imu)
_POSE = StandardTopic(
    "pose",
    PoseStamped,
    (*ESTIMATE, "stateEstimateZ.quat"),
    _pose,
    in_world=True,
)
_SLOW = (
    StandardTopic(
        "magnetic_field",
        MagneticField,
        ("mag.x", "mag.y", "mag.z"),
        lambda header, values: MagneticField(header=header, magnetic_field=Vector3(*values)),
    ),
    StandardTopic(
        "temperature",
        Temperature,
        ("baro.temp",),
        lambda header, values: Temperature(header=header, temperature=values[0]),
    ),
    StandardTopic("pressure", Float32, ("baro.pressure",), _float),
    StandardTopic("battery", Float32, ("pm.vbat",), _float),
)

#: Periods of imu and pose, and of the other topics, ms: those of the C++ driver.
FAST_MS, SLOW_MS = 10, 100

#: Log blocks: period (ms), and topics. Six variables of four bytes fit in a packet.
STANDARD_BLOCKS = ((FAST_MS, (_IMU,)), (FAST_MS, (_POSE,)), (SLOW_MS, _SLOW))

#: Period of the log block with the vehicle's status, ms; its absence shows a restart.
STATUS_PERIOD_MS = 100

#: Variables in it, as far as the firmware has them: all 26 bytes of a packet.
STATUS_VARIABLES = (
    "pm.vbat",
    "radio.rssi",
    "supervisor.info",
    "stateEstimate.z",
    "stateEstimate.vz",
    "stateEstimate.yaw",
    "pm.state",
    "radio.numRxBc",
    "radio.numRxUc",
    "ctrltargetZ.z",
)

_VARIANCES_LIMIT = 2.0  #: Time in which variances come on a link, s: four of their periods.

_MOST_DATA = 30
_LINK = 3 << 2  #: Bits of the header that belong to the link; cflib sets them.

#: Ports of console, parameters, memory, log, high-level commands, supervisor and pings, whose
#: packets are for the driver.
_OWN_PORTS = frozenset({0, 2, 4, 5, 8, 9, 15})


@dataclass(eq=False)
class LogTopics:
    """Start a vehicle's log blocks and publish them."""

    _vehicle: BaseVehicle
    _on_status: Callable[[], None]
    battery: BatteryMonitor = field(init=False)
    rssi: float | None = None  #: Latest strength of the vehicle's reception (-dBm).
    power_state: int = VehicleStatus.PM_STATE_UNKNOWN  #: The firmware's pm.state.
    #: received_broadcasts, received_unicasts: Packets that the vehicle has counted, modulo 2^16.
    received_broadcasts: int = 0
    received_unicasts: int = 0
    #: height, vertical_speed, heading: Latest estimate of the vehicle: z (m, fixed frame), its
    #: derivative (m/s), yaw (degrees).
    height: float | None = None
    vertical_speed: float | None = None
    heading: float | None = None
    target_height: float | None = None  #: z that the vehicle's controller holds, m, fixed frame.
    #: Latest state; None until it has come on the present link.
    supervisor: SupervisorState | None = None
    #: Variances of the vehicle's Kalman filter, if it has one.
    variances: Variances = field(default_factory=Variances)
    #: The external poses that it is sent, beside its estimate.
    agreement: PoseAgreement = field(default_factory=PoseAgreement)
    #: The state of its own positioning; None where it is flown by motion capture.
    positioning: Positioning | None = None
    _packets: Publisher | None = None
    _logs_state: bool = False

    def __post_init__(self) -> None:
        self._state_news, self._variances_news = (News(self._vehicle.handle) for _ in range(2))
        self._deliver_packet = self._vehicle.delivery.outlet(self._publish_packet, are_data=True)
        server = self._vehicle.server
        self.battery = BatteryMonitor(
            server.battery_low, server.battery_critical, server.battery_critical_time
        )

    @property
    def is_flying(self) -> bool:
        """Whether the vehicle logs that it flies; so it does for 2 s after a landing."""
        return self.supervisor is not None and SupervisorState.FLYING in self.supervisor

    def start(self) -> None:
        """Announce the topics and start the log blocks; blocks.

        Raises `CrazyflieError` if a custom block is not possible.
        """
        parameters = self._vehicle.parameters
        if "packets" in parameters.topics:
            self._packets = self._vehicle.publisher("packets", crtpPacket)
        known = self._vehicle.crazyflie.log.variables()
        self._start_status(known)
        self._start_filter(known)
        topics = parameters.topics
        if parameters.is_own_estimate:
            self._start_positioning(parameters.positioning, known)
            topics -= {_POSE.name}
        for period_ms, block in STANDARD_BLOCKS:
            chosen = [topic for topic in block if topic.name in topics]
            self._start_standard(period_ms, chosen, known)
        if parameters.enable_logging:
            for block in parameters.log_blocks:
                self._start_custom(block)

    def estimate_problem(self) -> str:
        """Return why the vehicle's own position is a wrong one; empty if that is not known.

        The planner, and setpoints with a reference, would fly it elsewhere.
        """
        return self.estimator_problem() or self.agreement.problem(self._vehicle.handle.time())

    def estimator_problem(self) -> str:
        """Return why its estimator knows no position; empty if it does, or is not known."""
        try:
            return estimator_problem(self._vehicle.crazyflie.parameters.known(ESTIMATOR))
        except LinkLostError:
            return ""

    def forget_state(self) -> None:
        """Forget the state and the variances: those from before a loss are outdated."""
        self.supervisor = None
        self.variances.clear()

    def next_state(self, limit: float) -> SupervisorState | None:
        """Return the state that comes next within a limit (s); None if none comes; blocks.

        It returns at once if the vehicle has no log variable of its state.
        """
        if not self._logs_state:
            return None
        return self.supervisor if self._state_news.wait(limit) else None

    def variances_problem(self) -> str:
        """Return why the Kalman filter has not converged, empty if it has, or unknown; blocks."""
        while not self.variances.are_enough and self._variances_news.wait(_VARIANCES_LIMIT):
            pass
        return self.variances.problem()

    def publish_packet(self, port: int, channel: int, data: bytes) -> None:
        """Publish a packet from the vehicle, unless it is for the driver; from any thread."""
        if self._packets is not None and port not in _OWN_PORTS:
            self._deliver_packet(port, channel, data.hex())

    def _publish_packet(self, port, channel, text):
        if self._packets is not None:
            data = bytes.fromhex(text)
            self._packets.publish(
                crtpPacket(
                    size=1 + len(data),
                    header=port << 4 | _LINK | channel,
                    data=data[:_MOST_DATA].ljust(_MOST_DATA, b"\0"),
                )
            )

    def _log(self, name, period_ms, variables, receive):
        """Start a block; ``receive(arrival, time_ms, values)`` is called in turn, s and ms."""
        handle = self._vehicle.handle
        deliver = self._vehicle.delivery.outlet(receive, are_data=True)
        block = LogBlock(
            name,
            period_ms,
            tuple(variables),
            lambda time_ms, values: deliver(handle.time(), time_ms, values),
        )
        self._vehicle.crazyflie.add_log_block(block)

    def _start_status(self, known):
        vehicle = self._vehicle
        publishers = vehicle.publisher("heading", Float32), vehicle.publisher("rssi", Float32)
        variables = [variable for variable in STATUS_VARIABLES if variable in known]
        self._logs_state = "supervisor.info" in known

        def receive(_arrival, _time_ms, values):
            self._note_status(dict(zip(variables, values, strict=True)), *publishers)

        if variables:
            self._log("status", STATUS_PERIOD_MS, variables, receive)

    def _start_filter(self, known):
        # In one block of 24 bytes: the firmware has room for 16 blocks.
        logs_variances, logs_position = (
            all(name in known for name in names) for names in (VARIANCES, ESTIMATE)
        )
        self.variances.is_logged = logs_variances
        size = len(VARIANCES) if logs_variances else 0
        variables = (*VARIANCES[:size], *(ESTIMATE if logs_position else ()))

        def receive(_arrival, _time_ms, values):
            if logs_variances:
                self.variances.add(tuple(values[:size]))
                self._variances_news.tell()
            if logs_position:
                self._note_estimate(values[size:])

        if variables:
            self._log("filter", VARIANCES_PERIOD_MS, variables, receive)

    def _note_estimate(self, position):
        now = self._vehicle.handle.time()
        before = self.agreement.problem(now)
        self.agreement.estimate(now, position)
        text = self.agreement.problem(now)
        if text and not before and self.is_flying:
            self._vehicle.warn(text)

    def _start_positioning(self, source, known):
        vehicle, system = self._vehicle, SYSTEMS[source]
        check_deck(source, vehicle.crazyflie.parameters.values())
        needed = (*system.variables, *_POSE.variables)
        if missing := [name for name in needed if name not in known]:
            raise ServiceError(
                f"positioning is {source}, and the firmware does not log {', '.join(missing)}; "
                "update the firmware"
            )
        positioning = self.positioning = Positioning(source)
        publisher = vehicle.publisher(POSITIONING_TOPIC, String, latch=True)
        before = None

        def follow():
            nonlocal before
            text = positioning.problem(vehicle.handle.time())
            if text != before:
                if text and before == "":
                    vehicle.warn(text)
                before = text
                publisher.publish(String(text))

        def receive(arrival, _time_ms, values):
            positioning.update(arrival, values)
            follow()

        self._log("positioning", PERIOD_MS, system.variables, receive)
        vehicle.handle.timer(PERIOD_MS / 1000.0, follow)
        self._start_estimate(positioning)

    def _start_estimate(self, positioning):
        """Publish the vehicle's pose also as motion capture publishes one, with its own time."""
        vehicle = self._vehicle
        handle, frame = vehicle.handle, vehicle.parameters.estimate_frame
        publisher = self._vehicle.publisher(_POSE.name, PoseStamped)
        broadcast = handle.broadcast_transforms()

        def stamp_of(arrival, time_ms):
            time = positioning.local_time(time_ms / 1000.0, arrival)
            return None if time is None else handle.stamp(time)

        def publish(stamp, values):
            message = _pose(self._header(stamp, True), values)
            publisher.publish(message)
            # On a new link the estimate may have begun elsewhere, until the vehicle is set up.
            is_set_up = vehicle.state not in (ConnectionState.LOST, ConnectionState.RESUMING)
            if is_set_up and positioning.is_usable(handle.time()):
                place, orientation = message.pose.position, message.pose.orientation
                transform = Transform(Vector3(place.x, place.y, place.z), orientation)
                broadcast([TransformStamped(message.header, frame, transform)])

        self._log_stamped(_POSE.name, FAST_MS, _POSE.variables, publish, stamp_of)

    def _note_status(self, latest, heading_publisher, rssi_publisher):
        if "supervisor.info" in latest:
            self.supervisor = SupervisorState(latest["supervisor.info"])
            self._state_news.tell()
        if "pm.vbat" in latest:
            self.battery.update(latest["pm.vbat"], self._vehicle.handle.time())
        self.power_state = latest.get("pm.state", VehicleStatus.PM_STATE_UNKNOWN) & 0xFF
        self.received_broadcasts = latest.get("radio.numRxBc", 0)
        self.received_unicasts = latest.get("radio.numRxUc", 0)
        self.height = latest.get("stateEstimate.z")
        self.vertical_speed = latest.get("stateEstimate.vz")
        self.heading = latest.get("stateEstimate.yaw")
        target = latest.get("ctrltargetZ.z")
        self.target_height = None if target is None else target / 1000.0
        if self.heading is not None:
            heading_publisher.publish(Float32(math.radians(self.heading)))
        # The Crazyradio's figure is the same, and comes without the firmware's help.
        self.rssi = self._vehicle.crazyflie.rssi
        if self.rssi is None:
            self.rssi = latest.get("radio.rssi")
        if self.rssi is not None:
            rssi_publisher.publish(Float32(self.rssi))
        self._on_status()

    def _start_standard(self, period_ms, topics, known):
        outlets = []
        for topic in topics:
            if lacking := [variable for variable in topic.variables if variable not in known]:
                text = f"no topic {topic.name}: the firmware has no {', '.join(lacking)}"
                self._vehicle.warn(text)
            else:
                outlets.append((topic, self._vehicle.publisher(topic.name, topic.message_type)))
        if not outlets:
            return

        def publish(stamp, values):
            begin = 0
            for topic, publisher in outlets:
                end = begin + len(topic.variables)
                header = self._header(stamp, topic.in_world)
                publisher.publish(topic.convert(header, values[begin:end]))
                begin = end

        name = "+".join(topic.name for topic, _ in outlets)
        variables = [variable for topic, _ in outlets for variable in topic.variables]
        self._log_stamped(name, period_ms, variables, publish, self._stamp)

    def _start_custom(self, block):
        publisher = self._vehicle.publisher(block.topic_name, GenericLogData)

        def publish(stamp, values):
            header = self._header(stamp, False)
            publisher.publish(GenericLogData(header=header, values=list(map(float, values))))

        # The field is called frequency, and is a period.
        period = block.frequency - block.frequency % PERIOD_STEP_MS
        if period != block.frequency:
            self._vehicle.warn(
                f"log block {block.topic_name}: its period is {block.frequency} ms; the firmware "
                f"counts in steps of {PERIOD_STEP_MS} ms: it comes every {period} ms"
            )
        self._log_stamped(block.topic_name, period, block.variables, publish, self._stamp)

    def _log_stamped(self, name, period_ms, variables, publish, stamp_of):
        def receive(arrival, time_ms, values):
            stamp = stamp_of(arrival, time_ms)
            if stamp is not None:
                publish(stamp, values)

        self._log(name, period_ms, variables, receive)

    def _stamp(self, arrival, time_ms):
        if self._vehicle.parameters.use_ros_time:
            return self._vehicle.handle.stamp(arrival)
        return genpy.Time(*divmod(time_ms * 1_000_000, 1_000_000_000))

    def _header(self, stamp, in_world):
        vehicle = self._vehicle
        frame = vehicle.server.fixed_frame if in_world else vehicle.parameters.frame
        return Header(stamp=stamp, frame_id=frame)
