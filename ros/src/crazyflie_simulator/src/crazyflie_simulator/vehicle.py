"""A vehicle simulated in fixed steps, and its poses as motion capture measures them."""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator, default_rng
from numpy.typing import NDArray

from crazyflie_model.angles import Quaternion, Triple, turned
from crazyflie_model.dynamics import STEP, Dynamics, SevenDimensional, watchdog_control
from crazyflie_model.elementwise import Vector

_OFF: Vector[float] = [0.0, 0.0, 0.0, 0.0]

#: Most steps that are taken at once, from a control on: a divisor of the ages, in steps, at which
#: `watchdog_control` changes it.
_STEPS_TOGETHER = 10


class SimulatedVehicle:
    """One simulated vehicle, with the firmware's watchdog.

    It stays put at ``position`` (m, fixed frame), from ``time`` (s) on, until the first control.
    A control acts ``delay`` (s) after its command.
    When controls stop coming it reacts like the firmware; see `watchdog_control`. A vehicle that
    is tilted more than ``max_tilt`` (rad) has crashed: its motors stay off until `recover`.

    Two vehicles that are given the same controls at the same times fly the same, to the last bit,
    however often `advance_to` is called.
    """

    def __init__(
        self,
        dynamics: Dynamics,
        position: Sequence[float],
        time: float,
        max_tilt: float = math.inf,
        delay: float = 0.0,
    ):
        self.has_crashed = False
        self._can_crash = math.isfinite(max_tilt)
        self._least_upright = math.cos(max_tilt) if self._can_crash else 0.0
        self._dynamics = dynamics
        self._x = dynamics.initial_state(_floats(position))
        self._u: Vector[float] = _OFF
        self._start = time
        self._steps = 0
        # The step, and its state, from which the next ones are calculated.
        self._origin, self._x_origin = 0, self._x
        self._control_step: int | None = None
        self._delay_steps = round(delay / STEP)
        # Delayed controls, with the steps from which they act.
        self._pending: deque[tuple[int, Vector[float]]] = deque()

    @property
    def time(self) -> float:
        """Time of the state, s: a whole number of steps after the beginning."""
        return self._start + self._steps * STEP

    @property
    def state(self) -> NDArray[np.float64]:
        """State of the dynamics, shape (x_dim,)."""
        return np.array(self._x)

    @property
    def pose(self) -> tuple[Triple, Quaternion]:
        """Position (x, y, z) in m and quaternion (x, y, z, w) in the fixed frame."""
        return self._dynamics.pose(self._x, self._effective_control(self._steps))

    def command(self, u: Sequence[float]) -> None:
        """Set the control, u_dim components, from the present step and the delay on."""
        if self._delay_steps:
            self._pending.append((self._steps + self._delay_steps, _floats(u)))
            return
        self._set_control(_floats(u), self._steps)

    def disturb(self, disturbance: Sequence[float]) -> None:
        """Set the `SevenDimensional.disturbance` of the dynamics from the present step on."""
        assert isinstance(self._dynamics, SevenDimensional)
        self._dynamics.disturbance = _floats(disturbance)
        self._origin, self._x_origin = self._steps, self._x

    def recover(self) -> None:
        """Enable the motors of a crashed vehicle from the next control on."""
        self.has_crashed = False
        if self._control_step is not None:
            self._set_control(_OFF, self._control_step)

    def skip(self, duration: float) -> None:
        """Advance the time by ``duration`` (s) without motion."""
        self._start += duration

    def advance_to(self, time: float) -> None:
        """Integrate to the last whole step before ``time`` (s).

        A ``time`` in the past is a reset of the clock: the vehicle continues
        from there.
        """
        steps = math.floor((time - self.time) / STEP + 1e-6)
        if steps < -1:
            self._start, self._steps = time, 0
            self._pending.clear()
            self._set_control(self._u, None if self._control_step is None else 0)
        elif self._control_step is None and not self._pending:
            self._steps += max(steps, 0)
        else:
            end = self._steps + steps
            while self._steps < end:
                while self._pending and self._pending[0][0] <= self._steps:
                    step, u = self._pending.popleft()
                    self._set_control(u, step)
                self._advance(end)
                self._notice_crash()

    def _set_control(self, u, step):
        self._u, self._control_step = u, step
        self._origin, self._x_origin = self._steps, self._x

    def _advance(self, end):
        """Advance with constant control up to the step ``end`` at most."""
        change = self._pending[0][0] if self._pending else math.inf
        if self._control_step is None:
            self._steps = min(end, change)
            return
        origin = self._origin
        u = self._effective_control(origin)
        together = 1 if self._can_crash else _STEPS_TOGETHER
        passed = (origin - self._control_step) % together
        next_origin = min(origin + together - passed, change)
        self._steps = min(end, next_origin)
        self._x = self._dynamics.steps(self._steps - origin, origin, self._x_origin, u)
        # Rounding errors of a formula must not depend on the times of `advance_to`.
        if self._steps == next_origin or not self._dynamics.has_exact_steps:
            self._origin, self._x_origin = self._steps, self._x

    def _notice_crash(self):
        if not self._can_crash:
            return
        _, (x, y, _, _) = self.pose
        # The cosine of the tilt, from the quaternion.
        if 1.0 - 2.0 * (x * x + y * y) < self._least_upright:
            self.has_crashed = True

    def _effective_control(self, step):
        if self.has_crashed:
            return _OFF
        if self._control_step is None:
            return self._u
        return watchdog_control(self._u, step - self._control_step)


def _floats(vector: Sequence[float]) -> Vector[float]:
    return [float(each) for each in vector]


#: Time of a measurement (s), position (m), quaternion (x, y, z, w).
Pose = tuple[float, Triple, Quaternion]


@dataclass(eq=False)
class MotionCapture:
    """Measured poses: with noise, latency and dropouts; all of them may be changed at any time."""

    #: Standard deviation of the position along each axis (m).
    position_noise: float = 0.0
    #: Standard deviation of the rotation about each axis of the body (rad).
    attitude_noise: float = 0.0
    latency: float = 0.0  #: Time from a measurement to its arrival (s).
    dropout: float = 0.0  #: Probability in [0, 1] that a pose is lost.
    seed: int | Sequence[int] = 0  #: The same one gives the same errors to the same poses.

    def __post_init__(self) -> None:
        self._in_transit: deque[Pose] = deque()

    @functools.cached_property
    def _random(self) -> Generator:
        return default_rng(self.seed)

    @property
    def is_perfect(self) -> bool:
        """Whether poses arrive without errors and latency."""
        errors = (self.position_noise, self.attitude_noise, self.latency, self.dropout)
        return not (any(errors) or self._in_transit)

    def measure(self, time: float, position: Triple, quaternion: Quaternion) -> None:
        """Measure the pose at ``time`` (s): position (m) and quaternion (x, y, z, w).

        A time before that of the last call is a reset of the clock: poses in transit are lost.
        """
        if self._in_transit and time < self._in_transit[-1][0]:
            self._in_transit.clear()
        if self.dropout > 0.0 and self._random.random() < self.dropout:
            return
        if self.position_noise > 0.0:
            error = self._random.normal(0.0, self.position_noise, 3).tolist()
            x, y, z = (a + b for a, b in zip(position, error, strict=True))
            position = (x, y, z)
        if self.attitude_noise > 0.0:
            error = self._random.normal(0.0, self.attitude_noise, 3).tolist()
            quaternion = turned(quaternion, error)
        self._in_transit.append((time, position, quaternion))

    def arrivals(self, time: float) -> list[Pose]:
        """Return the poses that have arrived since the last call, oldest first."""
        arrived = []
        while self._in_transit and self._in_transit[0][0] + self.latency <= time + 1e-9:
            arrived.append(self._in_transit.popleft())
        return arrived
