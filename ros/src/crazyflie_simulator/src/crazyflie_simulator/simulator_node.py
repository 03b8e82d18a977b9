"""ROS interface of a simulated vehicle, whatever its model."""

import math
import zlib
from collections import deque
from typing import Any

from std_srvs.srv import Empty
from typing_extensions import override

from crazyflie_model.dynamics import Coupled7D, Dynamics, NearHover
from crazyflie_msgs.msg import ControlStamped, DisturbanceStamped
from crazyflie_simulator.vehicle import MotionCapture, SimulatedVehicle
from crazyflie_utils import (
    Node,
    NodeHandle,
    ParameterError,
    Parameters,
    StampedPose,
    parameter,
    topic,
)
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import (
    BOOLEAN,
    FRAME,
    METRES,
    SHARE,
    TIME_STEP,
    Integer,
    Number,
)
from crazyflie_utils.vectors import to_tuple

LATENESS = 0.1
"""Delay above which a tick is late, and age beyond which poses are left out then (s)."""

LATE_TICKS, WINDOW = 5, 10.0
"""Number of late ticks, and period (s), that are reported."""


class RealTimeWatch:
    """Warns when ticks of a timer in real time often come late."""

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        self._last = math.inf
        self._late: deque[float] = deque(maxlen=LATE_TICKS)

    def tick(self, period: float) -> None:
        """Record a tick that was due ``period`` (s) after the last one."""
        now = self._handle.time()
        interval, self._last = now - self._last, now
        if interval <= period + LATENESS:
            return
        self._late.append(now)
        if len(self._late) == LATE_TICKS and now - self._late[0] < WINDOW:
            self._handle.warn(
                f"this computer is too busy: {LATE_TICKS} times in {now - self._late[0]:.1f} s "
                f"the simulator was late by more than {LATENESS:g} s. The flight will be wrong; "
                "with sim_time:=true real_time_factor:=0 it does not depend on the load",
                throttle=WINDOW,
                key="busy",
            )


#: Longest time that is integrated at once (s); a longer one, after a jump of the clock, is skipped.
MAX_CATCH_UP = 1.0
IDLE_PERIOD = 0.1  #: Period at which a simulator without pose consumers checks for them (s).


class MotionCaptureParameters(Parameters):
    """Errors of the motion capture system: the attributes of `MotionCapture`."""

    position_noise: float = parameter(
        Number("m", minimum=0.0, maximum=100.0), "standard deviation, each axis", 0.0, live=True
    )
    attitude_noise: float = parameter(
        Number("rad", minimum=0.0, maximum=10.0),
        "standard deviation, each axis of the body",
        0.0,
        live=True,
    )
    latency: float = parameter(
        Number("s", minimum=0.0, maximum=10.0),
        "from a pose to its broadcast, rounded up to whole time steps; the stamp stays the pose's",
        0.0,
        live=True,
    )
    dropout: float = parameter(SHARE, "probability that a pose is not broadcast", 0.0, live=True)


class ClockParameters(Parameters):
    """Whether a simulator makes simulated time, and how fast."""

    publish: bool = parameter(
        BOOLEAN, "whether to be the source of simulated time; needs `/use_sim_time`", False
    )
    real_time_factor: float = parameter(
        Number(minimum=0.0),
        "largest speed of simulated time, over real time; 0 is as fast as possible",
        1.0,
    )

    def period(self, time_step: float) -> float:
        """Return the shortest time, s, for a time step of simulated time (s)."""
        return time_step / self.real_time_factor if self.real_time_factor > 0.0 else 0.0


class SimulatorParameters(Parameters):
    """Parameters of every `SimulatorNode`."""

    time_step: float = parameter(TIME_STEP, "period of the broadcasts")
    init_x: float = parameter(METRES, "initial position; the ground is z = 0", name="init/x")
    init_y: float = parameter(METRES, "initial position; the ground is z = 0", name="init/y")
    init_z: float = parameter(METRES, "initial position; the ground is z = 0", name="init/z")
    fixed_frame: str = parameter(FRAME, "tf frame of the world", name="frames/fixed")
    robot_frame: str = parameter(FRAME, "tf frame of the vehicle", name="frames/robot")
    control_topic: str = topic("control", "where controls come from")
    clock: ClockParameters = group(ClockParameters, "clock")
    mocap: MotionCaptureParameters = group(MotionCaptureParameters, "mocap")
    seed: int = parameter(
        Integer(0, 2**32 - 1),
        "seed of all random numbers; motion capture errors also differ by the node's name",
        0,
    )


class SimulatorNode(Node[SimulatorParameters]):
    """Simulates a vehicle with the controls of a topic, and broadcasts its pose to tf.

    A subclass defines the vehicle's model in `make_dynamics`.
    """

    needed_in_flight = True

    max_tilt = math.inf  #: See `SimulatedVehicle`; for models that can turn over.
    delay = 0.0  #: Delay from a control to its effect (s).

    def __init__(self) -> None:
        self._ticks = 0
        self._broadcast_ticks: int | None = None
        self._is_idle = False
        self._measured_at: float | None = None
        self._crash_is_known = False

    def make_dynamics(self, parameters: Any) -> Dynamics:
        """Return the model of the vehicle for parameters of the type `parameters_type`."""
        raise NotImplementedError

    def reconfigure(self, parameters: Any) -> None:
        """Apply live parameters that were changed; see `NodeHandle.load`."""
        for name, value in vars(parameters.mocap).items():
            setattr(self._motion_capture, name, value)

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        parameters = handle.load(self.parameters_type, self.reconfigure)
        self._publishes_clock = parameters.clock.publish
        if self._publishes_clock and not handle.uses_sim_time:
            raise ParameterError(
                f"parameter {handle.resolve('~clock/publish')} is true, but /use_sim_time is "
                "not; expected both, so that nodes use /clock"
            )
        self._parameters = parameters
        self._motion_capture = MotionCapture(
            **vars(parameters.mocap),
            # Vehicles with the same seed have different errors.
            seed=(parameters.seed, zlib.crc32(handle.name.encode())),
        )
        self._dynamics = self.make_dynamics(parameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        handle.claim_controls(parameters.control_topic, "simulated")
        position = (parameters.init_x, parameters.init_y, parameters.init_z)
        self._start = handle.time()
        self._vehicle = SimulatedVehicle(
            self._dynamics, position, self._start, self.max_tilt, self.delay
        )
        self._broadcast = handle.broadcast_poses(lambda: self._catch_up(handle.time()))
        if self._publishes_clock:
            self._set_clock = handle.clock_publisher()
        handle.advertise_service("~reset", Empty, self._on_reset)
        handle.subscribe(
            parameters.control_topic, ControlStamped, self._on_control, finite="control"
        )
        if self._publishes_clock:
            period = parameters.clock.period(parameters.time_step)
            handle.timer(period, self._on_clock_timer, steady=True)
        else:
            self._watch = RealTimeWatch(handle)
            self._timer = handle.timer(parameters.time_step, self._on_timer)

    def _on_control(self, message):
        # One reading of the clock: the process may be interrupted between two, and the vehicle
        # would be ahead of the poses that are still to be broadcast.
        now = self._handle.time()
        self._catch_up(now)
        # Without a clock of its own, the vehicle must catch up completely, so that the
        # control takes effect now and not at the last tick.
        if not self._publishes_clock:
            self._advance_to(now)
        self._vehicle.command(to_tuple(message.control))

    def _on_reset(self, _):
        self._vehicle.recover()

    def _on_timer(self):
        if self._handle.uses_sim_time:
            self._advance_to(self._handle.time())
            self._broadcast_pose()
        else:
            self._watch.tick(max(IDLE_PERIOD, self._parameters.time_step))
            self._catch_up(self._handle.time())

    def _catch_up(self, now):
        """Advance to the clock, which is at ``now`` (s); broadcast poses with listeners."""
        if self._publishes_clock:
            if self._ticks != self._broadcast_ticks:
                self._broadcast_ticks = self._ticks
                self._advance_to(self._tick_time(self._ticks))
                self._broadcast_pose()
        elif not self._handle.uses_sim_time:
            self._broadcast_missed(now)
            self._set_pace()

    def _broadcast_missed(self, now):
        """Broadcast the poses of all time steps until now, s, with their own stamps."""
        step = self._parameters.time_step
        due = math.floor((now - self._start) / step + 1e-6)
        missed = min(due - self._ticks, math.ceil(LATENESS / step))
        if missed > 1 and (self._is_idle or self._has_no_consumers()):
            missed = 1
        for tick in range(due - missed + 1, due + 1):
            self._advance_to(self._tick_time(tick))
            self._broadcast_pose()
        self._ticks = due

    def _set_pace(self):
        self._is_idle = self._has_no_consumers()
        step = self._parameters.time_step
        self._timer.set_period(max(IDLE_PERIOD, step) if self._is_idle else step)

    def _has_no_consumers(self):
        """Return whether poses need not be broadcast in time."""
        # Errors are drawn pose by pose, in sequence.
        return self._motion_capture.is_perfect and not self._handle.has_pose_consumers()

    def _tick_time(self, tick):
        return self._start + tick * self._parameters.time_step

    def _advance_to(self, now):
        skipped = now - self._vehicle.time - max(MAX_CATCH_UP, self._parameters.time_step)
        if skipped > 0.0:
            # Simulated time is 0 until the first message on /clock, which may begin anywhere.
            if self._vehicle.time > 0.0:
                self._handle.warn(
                    f"time has jumped by {skipped:.1f} s more than can be simulated; the vehicle "
                    "skips that time",
                    throttle=1.0,
                    key="skipped time",
                )
            self._vehicle.skip(skipped)
        self._vehicle.advance_to(now)
        if self._vehicle.has_crashed and not self._crash_is_known:
            self._handle.warn(
                f"the vehicle has tilted by more than {math.degrees(self.max_tilt):.0f} degrees: "
                f"motors off until {self._handle.resolve('~reset')} is called"
            )
        self._crash_is_known = self._vehicle.has_crashed

    def _on_clock_timer(self):
        before = self._ticks
        if self._has_no_consumers():
            self._ticks += self._ticks_to_next_event()
        else:
            self._ticks += 1
            self._catch_up(self._handle.time())
        passed = map(self._tick_time, range(before + 1, self._ticks))
        self._set_clock(self._tick_time(self._ticks), passed)

    def _ticks_to_next_event(self):
        parameters = self._parameters
        if parameters.clock.real_time_factor > 0.0:
            return 1
        wait = self._handle.next_event() - self._tick_time(self._ticks)
        # A new consumer receives poses soon.
        wait = min(max(wait, 0.0), IDLE_PERIOD)
        return max(math.ceil((wait - 1e-6) / parameters.time_step), 1)

    def _broadcast_pose(self):
        now = self._vehicle.time
        if now == self._measured_at:
            return
        self._measured_at = now
        self._motion_capture.measure(now, *self._vehicle.pose)
        parameters, nanoseconds = self._parameters, self._handle.nanoseconds
        poses = [
            StampedPose(
                parameters.fixed_frame,
                parameters.robot_frame,
                nanoseconds(time),
                position,
                rotation,
            )
            for time, position, rotation in self._motion_capture.arrivals(now)
        ]
        if poses:
            self._broadcast(poses)


class SevenDimensionalSimulatorParameters(SimulatorParameters):
    """Parameters of the simulators of models with 7 states."""

    disturbance_topic: str | None = topic(
        "disturbance", "what is added to the derivative of each state, until the next one", None
    )


class SevenDimensionalSimulatorNode(SimulatorNode):
    """A vehicle with 7 states, which a topic may disturb."""

    parameters_type = SevenDimensionalSimulatorParameters
    _parameters: SevenDimensionalSimulatorParameters

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        super().register_callbacks(handle)
        if name := self._parameters.disturbance_topic:
            handle.subscribe(name, DisturbanceStamped, self._on_disturbance, finite="disturbance")

    def _on_disturbance(self, message):
        # As for a control: the vehicle is first where the old disturbance has brought it.
        now = self._handle.time()
        self._catch_up(now)
        if not self._publishes_clock:
            self._advance_to(now)
        self._vehicle.disturb(to_tuple(message.disturbance))


class NearHoverSimulatorNode(SevenDimensionalSimulatorNode):
    """A vehicle with near-hover dynamics."""

    @override
    def make_dynamics(self, parameters: SimulatorParameters) -> Dynamics:
        return NearHover()


class NearHoverSimulatorCoupled7DNode(SevenDimensionalSimulatorNode):
    """A vehicle whose thrust, tilt and yaw are coupled."""

    @override
    def make_dynamics(self, parameters: SimulatorParameters) -> Dynamics:
        return Coupled7D()
