"""ROS interface of many simulated vehicles of one model."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout
from typing_extensions import override

from crazyflie_fleet.fleet_config import VehicleConfig
from crazyflie_fleet.vectorized_vehicles import VectorizedVehicles
from crazyflie_fleet.vehicle_nodes import (
    FINAL_CONTROL,
    LQR_CONTROL,
    SAFE_DESCENT,
    SAFE_REFERENCE,
    STATE,
)
from crazyflie_lqr.gain_file import CONTROL_FILE, MatrixFile
from crazyflie_lqr.linear_feedback import (
    IntegralStateFeedback,
    heading_error,
    limited,
    linear_control,
)
from crazyflie_model.angles import quaternion_from_rpy, wrap_to_pi
from crazyflie_model.dynamics import Coupled7D, NearHover, SevenDimensional
from crazyflie_model.elementwise import join, split
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_references.governed_references import GovernedReferences, ReferenceLimits
from crazyflie_simulator.simulator_node import MAX_CATCH_UP, ClockParameters, RealTimeWatch
from crazyflie_utils import Node, NodeHandle, ParameterError, Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import FRAME, TIME_STEP
from crazyflie_utils.tf.frame_tree import StampedPose
from crazyflie_utils.topics import Publisher
from crazyflie_utils.vectors import to_tuple

YAW = 6

#: Topic, below the node's name, with the states of all its vehicles in one message: in the order of
#: the file, rows of x, y, z, x_dot, y_dot, z_dot and yaw.
ALL_STATES = "states"

#: Models whose vehicles can be simulated together.
MODELS: dict[str, type[SevenDimensional]] = {"near_hover": NearHover, "coupled_7d": Coupled7D}


def state_message(header: Header, row: Sequence[float]) -> PositionVelocityYawStateStamped:
    """Return a state: x, y, z, x_dot, y_dot, z_dot in m and m/s, yaw in rad."""
    state = object.__new__(PositionVelocityYawState)
    state.x, state.y, state.z, state.x_dot, state.y_dot, state.z_dot, state.yaw = row
    message = object.__new__(PositionVelocityYawStateStamped)
    message.header, message.state = header, state
    return message


def control_message(header: Header, row: Sequence[float]) -> ControlStamped:
    """Return a control: roll and pitch in rad, yaw_dot in rad/s, thrust in m/s^2."""
    control = object.__new__(Control)
    control.roll, control.pitch, control.yaw_dot, control.thrust = row
    message = object.__new__(ControlStamped)
    message.header, message.control = header, control
    return message


def array_message(rows: NDArray[np.float64]) -> Float64MultiArray:
    """Return the states of n vehicles, shape (n, 7)."""
    n, size = rows.shape
    layout = MultiArrayLayout(
        [MultiArrayDimension("vehicle", n, n * size), MultiArrayDimension("state", size, size)], 0
    )
    return Float64MultiArray(layout, rows.ravel())


def batch_control(
    K: NDArray[np.float64],
    u_ref: NDArray[np.float64],
    x: NDArray[np.float64],
    x_ref: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the controls, shape (n, 4), of an `IntegralStateFeedback` without an integrator.

    Parameters
    ----------
    K : ndarray, shape (4, 7)
    u_ref : ndarray, shape (4,)
    x, x_ref : ndarray, shape (n, 7)
        States and references.
    """
    error = heading_error(split(x), split(x_ref))
    return join(limited(linear_control(K.tolist(), u_ref.tolist(), error)))


class VectorizedSimulatorParameters(Parameters):
    """Parameters of `VectorizedSimulatorNode`, named as those of the nodes that it replaces."""

    time_step: float = parameter(
        TIME_STEP, "period of poses, states and controls", name="simulator/time_step"
    )
    clock: ClockParameters = group(ClockParameters, "simulator/clock")
    fixed_frame: str = parameter(FRAME, "tf frame of the world", "world", "frames/fixed")
    K: NDArray[np.float64] = parameter(
        MatrixFile(4, 7), "gain file, 4 rows of 7 numbers", name="lqr_controller/K_file"
    )
    u_ref: NDArray[np.float64] = parameter(
        CONTROL_FILE, "control at the reference", name="lqr_controller/u_ref_file"
    )
    limits: ReferenceLimits = group(ReferenceLimits, "lqr_controller/reference")


class VectorizedSimulatorNode(Node):
    """Flies vehicles of one of `MODELS`, with 7 states; each vehicle has its own topics."""

    needed_in_flight = True

    def __init__(self, vehicles: tuple[VehicleConfig, ...], model: str):
        self._vehicles = vehicles
        self._model = model
        self._ticks = 0
        self._measured: tuple[float, NDArray[np.float64]] | None = None
        self._broadcast_time = math.nan
        self._references: list[GovernedReferences] = []
        self._states: list[Publisher] = []
        self._controls: list[Publisher] = []

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(VectorizedSimulatorParameters, self._change)
        self._K, self._u_ref = np.array(self._parameters.K), np.array(self._parameters.u_ref)
        if IntegralStateFeedback(self._K, self._u_ref, YAW).height_overshoots:
            raise ParameterError(
                f"{handle.name}: the gains' height loop overshoots, so that each vehicle needs a "
                "controller of its own; fly it with together:=false"
            )

    def _change(self, parameters):
        for references in self._references:
            references.change(parameters.limits)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._start = handle.time()
        places = [vehicle.position for vehicle in self._vehicles]
        self._batch = VectorizedVehicles(MODELS[self._model](), places, self._start)
        self._broadcast = handle.broadcast_poses(self._broadcast_poses)
        self._all_states = handle.publisher("~" + ALL_STATES, Float64MultiArray)
        if parameters.clock.publish:
            self._set_clock = handle.clock_publisher()
        for number, vehicle in enumerate(self._vehicles):
            self._register_vehicle(handle, number, f"/{vehicle.name}/")
        if parameters.clock.publish:
            period = parameters.clock.period(parameters.time_step)
            handle.timer(period, self._on_clock_timer, steady=True)
        else:
            self._watch = RealTimeWatch(handle)
            handle.timer(parameters.time_step, self._on_timer)

    def _register_vehicle(self, handle, number, below):
        handle.claim_controls(below + FINAL_CONTROL, "simulated")
        self._states.append(handle.publisher(below + STATE, PositionVelocityYawStateStamped))
        self._controls.append(handle.publisher(below + LQR_CONTROL, ControlStamped))
        handle.subscribe(
            below + FINAL_CONTROL,
            ControlStamped,
            partial(self._on_control, number),
            finite="control",
        )
        topics = below + SAFE_REFERENCE, below + SAFE_DESCENT
        limits, message_type = self._parameters.limits, PositionVelocityYawStateStamped
        self._references.append(GovernedReferences(handle, topics, message_type, YAW, limits))

    def _on_control(self, number, message):
        self._batch.command(number, to_tuple(message.control), self._handle.time())

    # Time steps.

    def _on_timer(self):
        if not self._handle.uses_sim_time:
            self._watch.tick(self._parameters.time_step)
        self._fly_to(self._handle.time())

    def _on_clock_timer(self):
        self._ticks += 1
        now = self._start + self._ticks * self._parameters.time_step
        self._fly_to(now)
        self._set_clock(now)

    def _fly_to(self, now):
        skipped = now - self._batch.time - max(MAX_CATCH_UP, self._parameters.time_step)
        if skipped > 0.0:
            # Simulated time is 0 until the first message on /clock, which may begin anywhere.
            if self._batch.time > 0.0:
                self._handle.warn(
                    f"time has moved by {skipped:.1f} s too much to simulate; the vehicles skip "
                    "that",
                    throttle=1.0,
                    key="skipped time",
                )
            self._batch.skip(skipped)
        self._batch.advance_to(now)
        time = self._batch.time
        if self._measured is not None and time == self._measured[0]:
            return
        states = self._batch.states
        before, self._measured = self._measured, (time, states)
        if self._handle.has_pose_consumers():
            self._broadcast_poses()
        header = Header(0, self._handle.stamp(time), self._parameters.fixed_frame)
        if before is not None and time > before[0]:
            self._control(header, _estimates(*before, time, states))

    def _broadcast_poses(self):
        """Broadcast the present poses, once."""
        if self._measured is None or self._broadcast_time == self._measured[0]:
            return
        self._broadcast_time, states = self._measured
        frame, stamp = self._parameters.fixed_frame, self._handle.nanoseconds(self._broadcast_time)
        tilts = self._batch.tilts.tolist()
        self._broadcast(
            [
                StampedPose(
                    frame, vehicle.name, stamp, (x, y, z), quaternion_from_rpy(roll, pitch, yaw)
                )
                for vehicle, (x, y, z, _, _, _, yaw), (roll, pitch) in zip(
                    self._vehicles, states.tolist(), tilts, strict=True
                )
            ]
        )

    def _control(self, header, estimates):
        self._all_states.publish(array_message(estimates))
        rows = estimates.tolist()
        for publisher, row in zip(self._states, rows, strict=True):
            publisher.publish(state_message(header, row))
        found = [
            (number, x_ref)
            for number, (references, row) in enumerate(zip(self._references, rows, strict=True))
            if (x_ref := references.value(row)) is not None
        ]
        if not found:
            return
        numbers, x_refs = zip(*found, strict=True)
        controls = batch_control(self._K, self._u_ref, estimates[list(numbers)], np.array(x_refs))
        header = Header(0, header.stamp, "")
        for number, row in zip(numbers, controls.tolist(), strict=True):
            self._controls[number].publish(control_message(header, row))


def _estimates(
    time_before: float, before: NDArray[np.float64], time: float, states: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the states, with velocities by finite differences of poses, shape (n, 7)."""
    estimates = states.copy()
    estimates[:, 3:6] = (states[:, :3] - before[:, :3]) / (time - time_before)
    estimates[:, YAW] = wrap_to_pi(states[:, YAW])
    return estimates
