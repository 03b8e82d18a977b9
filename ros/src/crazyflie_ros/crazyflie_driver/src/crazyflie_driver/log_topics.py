"""Log data and application packets of a vehicle, as topics."""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import genpy
from std_msgs.msg import Float32, Header

from crazyflie_driver import telemetry, variances
from crazyflie_driver.delivery import Delivery
from crazyflie_driver.msg import GenericLogData, crtpPacket
from crazyflie_driver.variances import Variances
from crazyflie_driver.vehicle_parameters import VehicleParameters
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.log import PERIOD_STEP_MS, LogBlock
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle
from crazyflie_utils.topics import Publisher

#: Period of the log block that the diagnostics rest on, ms; its absence shows a restart.
STATUS_PERIOD_MS = 100

#: What is in it, as far as the firmware has it: all of the 26 bytes of a packet.
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

_MOST_DATA = 30
_LINK = 3 << 2  #: Bits of the header that belong to the link; cflib sets them.

#: Ports of console, parameters, memory, log, high-level commands, supervisor and pings: what comes
#: from there is for the driver.
_OWN_PORTS = frozenset({0, 2, 4, 5, 8, 9, 15})


@dataclass(eq=False)
class LogTopics:
    """Start a vehicle's log blocks and publish them."""

    _handle: NodeHandle
    _parameters: VehicleParameters
    _crazyflie: Crazyflie
    _delivery: Delivery
    _fixed_frame: str
    _on_status: Callable[[], None]
    #: voltage, rssi: Latest values of the battery (V) and the vehicle's reception (-dBm).
    voltage: float | None = None
    rssi: float | None = None
    power_state: int | None = None  #: The firmware's pm.state.
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
    #: Of the vehicle's Kalman filter, if it has one.
    variances: Variances = field(default_factory=Variances)
    _packets: Publisher | None = None
    _heading: Publisher = field(init=False)
    _logs_state: bool = False
    _states: int = 0
    _state_came: threading.Condition = field(default_factory=threading.Condition)

    def start(self) -> None:
        """Announce the topics and start the log blocks; blocks.

        Raises `CrazyflieError` if a custom block is not possible.
        """
        parameters = self._parameters
        if "packets" in parameters.topics:
            self._packets = self._publisher("packets", crtpPacket)
        known = self._crazyflie.log.variables()
        self._heading = self._publisher("heading", Float32)
        self._start_status(known, self._publisher("rssi", Float32))
        self._start_variances(known)
        selected = [topic for topic in telemetry.STANDARD if topic.name in parameters.topics]
        groups, missing = telemetry.packed(selected, known)
        for name, variables in missing.items():
            self._handle.warn(
                f"{parameters.name}: no topic {name}: the firmware has no " + ", ".join(variables)
            )
        for group in groups:
            self._start_standard(group)
        if parameters.enable_logging:
            for block in parameters.log_blocks:
                self._start_custom(block)

    def next_state(self, limit: float) -> SupervisorState | None:
        """Return the state that comes next within a limit (s); None if none comes; blocks.

        It returns at once if the vehicle has no log variable of its state.
        """
        if not self._logs_state:
            return None
        with self._state_came:
            before = self._states
            is_there = self._state_came.wait_for(lambda: self._states != before, limit)
            return self.supervisor if is_there else None

    def publish_packet(self, port: int, channel: int, data: bytes) -> None:
        """Publish a packet from the vehicle, if it is not one of the driver's own."""
        publisher = self._packets
        if publisher is None or port in _OWN_PORTS:
            return
        message = crtpPacket(
            size=1 + len(data),
            header=port << 4 | _LINK | channel,
            data=data[:_MOST_DATA].ljust(_MOST_DATA, b"\0"),
        )
        self._delivery.submit_data(publisher.publish, message)

    def _start_status(self, known, rssi_publisher):
        variables = tuple(variable for variable in STATUS_VARIABLES if variable in known)
        self._logs_state = "supervisor.info" in known
        if not variables:
            return

        def deliver(_, values):
            latest = dict(zip(variables, values, strict=True))
            self._note_state(latest)
            self._delivery.submit_data(self._note_status, latest, rssi_publisher)

        self._crazyflie.add_log_block(LogBlock("status", STATUS_PERIOD_MS, variables, deliver))

    def _start_variances(self, known):
        self.variances.is_logged = all(name in known for name in variances.VARIABLES)
        if self.variances.is_logged:
            self._crazyflie.add_log_block(
                LogBlock(
                    "variances",
                    variances.PERIOD_MS,
                    variances.VARIABLES,
                    lambda _, values: self.variances.add(tuple(values)),
                )
            )

    def _note_state(self, latest):
        # In the link's thread: the state is waited for where no callback has its turn.
        if "supervisor.info" in latest:
            with self._state_came:
                self.supervisor = SupervisorState(latest["supervisor.info"])
                self._states += 1
                self._state_came.notify_all()

    def _note_status(self, latest, rssi_publisher):
        self.voltage = latest.get("pm.vbat")
        self.power_state = latest.get("pm.state")
        self.received_broadcasts = latest.get("radio.numRxBc", 0)
        self.received_unicasts = latest.get("radio.numRxUc", 0)
        self.height = latest.get("stateEstimate.z")
        self.vertical_speed = latest.get("stateEstimate.vz")
        self.heading = latest.get("stateEstimate.yaw")
        target = latest.get("ctrltargetZ.z")
        self.target_height = None if target is None else target / 1000.0
        if self.heading is not None:
            self._heading.publish(Float32(math.radians(self.heading)))
        # The Crazyradio's figure is the same, and comes without the firmware's help.
        self.rssi = self._crazyflie.rssi
        if self.rssi is None:
            self.rssi = latest.get("radio.rssi")
        if self.rssi is not None:
            rssi_publisher.publish(Float32(self.rssi))
        self._on_status()

    def _start_standard(self, group):
        publishers = [self._publisher(topic.name, topic.message_type) for topic in group]
        variables = sum((topic.variables for topic in group), ())

        def publish(stamp, values):
            begin = 0
            for topic, publisher in zip(group, publishers, strict=True):
                end = begin + len(topic.variables)
                header = self._header(stamp, topic.in_world)
                publisher.publish(topic.convert(header, values[begin:end]))
                begin = end

        name = "+".join(topic.name for topic in group)
        self._add(name, group[0].period_ms, variables, publish)

    def _start_custom(self, block):
        publisher = self._publisher(block.topic_name, GenericLogData)

        def publish(stamp, values):
            header = self._header(stamp, False)
            publisher.publish(GenericLogData(header=header, values=list(map(float, values))))

        # The field is called frequency, and is a period.
        period = block.frequency - block.frequency % PERIOD_STEP_MS
        if period != block.frequency:
            self._handle.warn(
                f"{self._parameters.name}: log block {block.topic_name}: its period is "
                f"{block.frequency} ms; the firmware counts in steps of {PERIOD_STEP_MS} ms: it "
                f"comes every {period} ms"
            )
        self._add(block.topic_name, period, tuple(block.variables), publish)

    def _add(self, name, period_ms, variables, publish):
        def deliver(time_ms, values):
            self._delivery.submit_data(publish, self._stamp(time_ms), values)

        self._crazyflie.add_log_block(LogBlock(name, period_ms, variables, deliver))

    def _publisher(self, name, message_type):
        return self._handle.publisher(f"{self._parameters.prefix}/{name}", message_type)

    def _stamp(self, time_ms):
        if self._parameters.use_ros_time:
            return self._handle.stamp()
        return genpy.Time(*divmod(time_ms * 1_000_000, 1_000_000_000))

    def _header(self, stamp, in_world):
        frame = self._fixed_frame if in_world else self._parameters.frame
        return Header(stamp=stamp, frame_id=frame)
