"""Flights of simulated and virtual vehicles against their fences, and what their fences assume."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_geofence import bounds
from crazyflie_geofence.geofence import Geofence
from crazyflie_geofence.viable_set import Axis, response
from crazyflie_identification.residual import velocity_error
from crazyflie_lqr.linear_feedback import IntegralStateFeedback, limited
from crazyflie_model.angles import zyx_from_quaternion
from crazyflie_model.dynamics import coupled_acceleration
from crazyflie_model.limits import MAX_THRUST, MIN_THRUST
from crazyflie_model.quadrotor import TYPES
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_simulator.vehicle import MotionCapture, SimulatedVehicle
from crazyflie_state_estimator.control_response import ControlInput
from crazyflie_state_estimator.motion import (
    ACCELERATION_WALK_WITH_CONTROL,
    POSITION_NOISE,
    ConstantAccelerationFilter,
    FiniteDifference,
)

PERIOD = 0.01  #: Of poses and controls (s).
SETTLING = 8.0  #: Time until the integrator has found the weight (s).
CENTRE = np.array([0.0, 0.0, 4.0])  #: Of the box (m).
SPREAD = 0.03  #: Largest error of mass, and of thrust, as fractions.

#: K_quadrotor.txt, and its integrator.
GAINS = np.zeros((4, 7))
GAINS[[0, 0, 1, 1, 2, 3, 3], [1, 4, 0, 3, 6, 2, 5]] = (
    *(0.707106781187, 0.518806711514),
    *(-0.707106781187, -0.518806711514),
    *(-3.33333333333, -16.0, -8.94427191),
)
INTEGRATOR = ((-0.15, 0.15, -10.0), (0.2, 0.2, 0.25))


class Rigid:
    """A vehicle of the simulator with the firmware's loops."""

    def __init__(self, model, mass_error, thrust_error):
        self._model = model
        dynamics = StabilizedQuadrotor(model, mass_error, thrust_error)
        self._vehicle = SimulatedVehicle(dynamics, CENTRE.tolist(), 0.0)
        self.advance_to = self._vehicle.advance_to

    @property
    def pose(self):
        """Position in m, and quaternion."""
        return self._vehicle.pose

    @property
    def velocity(self):
        """m/s."""
        return self._vehicle.state[3:6]

    def send(self, roll, pitch, yaw_dot, pwm):
        """Command an attitude (rad, rad/s) and a thrust (PWM)."""
        self._vehicle.command((roll, pitch, yaw_dot, self._model.thrust(pwm)))


@dataclass(frozen=True)
class FencedFlight:
    """What was measured, and sent, at each pose; shapes (n, 3), but for ``commanded``."""

    positions: NDArray[np.float64]  #: positions, velocities: true ones, m and m/s.
    velocities: NDArray[np.float64]
    measured_positions: NDArray[np.float64]
    measured_velocities: NDArray[np.float64]
    commanded: NDArray[np.float64]  #: Accelerations, m/s^2.
    changed: NDArray[np.bool_]  #: Shape (n,), where the fence changed the control.
    #: Shape (n,), where the regular control would have left the set, by the errors at their worst.
    needed: NDArray[np.bool_]
    half: float  #: Half of the box, m.

    @property
    def outside(self) -> float:
        """How far outside of the box the vehicle was, m; negative if it was not."""
        return float(np.max(np.abs(self.positions - CENTRE)) - self.half)

    def position_error(self) -> float:
        """Return the largest error of a position, m."""
        return float(np.max(np.abs(self.measured_positions - self.positions)))

    def velocity_error(self, k: int, axis: Axis) -> float:
        """Return e_v along x, y or z (k), m/s, beside the disturbance of an axis."""
        largest = 0.0
        for sign in (1.0, -1.0):
            towards = np.maximum(sign * self.commanded[:, k], -axis.braking)
            gains = gained(towards, axis.tau, axis.delay)
            true, measured = self.velocities[:, k], self.measured_velocities[:, k]
            error = velocity_error(
                sign * true - gains, sign * measured - gains, axis.disturbance, PERIOD
            )
            largest = max(largest, error)
        return largest


def gained(commanded, tau, delay):
    """Return the velocities, (n,), m/s, that accelerations after a delay and a lag explain."""
    whole, part = divmod(delay, PERIOD)
    before, after = response(part, tau), response(PERIOD - part, tau)
    later = np.concatenate([np.full(int(whole) + 1, commanded[0]), commanded]).tolist()
    a, speed, speeds = later[0], 0.0, []
    for k in range(len(commanded)):
        speeds.append(speed)
        for r, u in ((before, later[k]), (after, later[k + 1])):
            speed += a * r.speed + u * r.held_speed
            a = a * r.fade + u * (1.0 - r.fade)
    return np.array(speeds)


def is_needed(fence, time, position, velocity, regular, yaw, before):
    """Return whether a regular control may lead out of the set, with all errors at their worst.

    ``before`` is the acceleration that was commanded before, m/s^2. As the fence reckons, without
    what it adds: a bend between samples, and the time for which it could hold its own controls.
    """
    moves = fence._predict(time, tuple(velocity))
    wanted = coupled_acceleration(regular, yaw)
    for i, (low, high, axis) in enumerate(fence._walls):
        for sign, room, (way, v, a) in (
            (1.0, high - position[i], moves[i]),
            (-1.0, position[i] - low, moves[i + 3]),
        ):
            u = sign * wanted[i]
            farthest = axis.reach(v + axis.velocity_margin, a, max(sign * before[i], u), u)
            if farthest > max(room - way - axis.position_margin, 0.0):
                return True
    return False


def fly(
    kind,
    name,
    seed,
    duration,
    axes,
    noise=0.0,
    kalman=False,
    spread=SPREAD,
    step=1.0,
    late=True,
    delay=0.0,
    half=1.0,
    path=None,
):
    """Fly against the walls: the reference jumps to and fro, up to 2 m beyond them.

    Or it follows ``path(t)``, which returns its position from the centre and its velocity. Controls
    arrive after ``delay`` (s) and up to a period.
    """
    random = np.random.default_rng(seed)
    model = TYPES[name]
    errors = random.uniform(-spread, spread, 2).tolist()
    vehicle = kind(model, *errors)
    mocap = MotionCapture(noise, noise, seed=seed)
    controller = IntegralStateFeedback(GAINS, np.array([0.0, 0.0, 0.0, 9.81]), 6, *INTEGRATOR)
    controller.enable_integrator()
    fence = Geofence(tuple(CENTRE - half), tuple(CENTRE + half), axes, bounds.max_thrust(name))
    velocities = FiniteDifference()
    if kalman:
        velocities = ConstantAccelerationFilter(POSITION_NOISE, ACCELERATION_WALK_WITH_CONTROL)
    response = ControlInput()
    latency = delay + random.uniform(0.0, 0.9) * PERIOD
    pending = deque()
    target, velocity, change = CENTRE, (0.0, 0.0, 0.0), 0.0
    commanded, rows, before = (0.0, 0.0, 0.0), [], None
    for tick in range(round((SETTLING + duration) / PERIOD)):
        t = tick * PERIOD
        while pending and pending[0][0] <= t:
            arrival, sent = pending.popleft()
            vehicle.advance_to(arrival)
            vehicle.send(*sent)
        vehicle.advance_to(t)
        true = np.array(vehicle.pose[0]), np.array(vehicle.velocity)
        mocap.measure(t, *vehicle.pose)
        ((_, position, quaternion),) = mocap.arrivals(t)
        yaw = zyx_from_quaternion(quaternion)[2]
        if not tick:
            velocities.start(position)
            continue
        p, v = velocities.step(
            PERIOD, position, response.response(response.acceleration(yaw, t), t)
        )
        since = t - SETTLING
        if path is not None:
            offset, velocity = path(max(since, 0.0))
            target = CENTRE + offset
        elif since >= change:
            change = since + step * 10.0 ** random.uniform(-0.5, 0.6)
            target = CENTRE + random.uniform(-2.0 - half, 2.0 + half, 3)
        reference = np.array([*target, *velocity, 0.0])
        regular = controller.control(np.array([*p, *v, yaw]), reference, t)
        control = regular = tuple(float(part) for part in limited(list(regular)))
        if since >= 0.0:
            answer = fence.control(t, tuple(p), tuple(v), yaw, control)
            # The merger may answer a control with what the fence has said of the last state.
            used = answer if before is None or not late or random.random() < 0.5 else before
            before = answer
            control = used[0] if used[1] else regular
        changed = control != regular
        needed = changed and is_needed(fence, t, p, v, regular, yaw, commanded)
        roll, pitch, yaw_dot, thrust = control
        thrust = min(max(thrust, MIN_THRUST), model.max_thrust, MAX_THRUST)
        fence.sent(t, control, yaw)
        response.command((roll, pitch, yaw_dot, thrust), t)
        commanded = tuple(coupled_acceleration((roll, pitch, yaw_dot, thrust), yaw))
        pending.append((t + latency, (roll, pitch, yaw_dot, round(model.pwm(thrust)))))
        if since >= -0.5:
            rows.append((*true, p, v, commanded, changed, needed))
    return FencedFlight(*(np.array(column) for column in zip(*rows, strict=True)), half)
