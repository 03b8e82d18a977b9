"""A reference that moves with a velocity in its own heading frame."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from typing_extensions import override

from crazyflie_model.angles import rotate_by_yaw, wrap_to_pi
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import Number


@dataclass(frozen=True)
class Velocity:
    """A velocity in the heading frame (x forward, y left, z up), m/s; yaw_dot in rad/s."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw_dot: float = 0.0


@dataclass(frozen=True)
class ReferencePose:
    """A place in the fixed frame, m, and a heading, rad."""

    x: float
    y: float
    z: float
    yaw: float


_SPEED = Number("m/s", above=0.0)


class LimitParameters(Parameters):
    """Limits of a reference."""

    horizontal: float = parameter(_SPEED, "largest speed, x and y together", 0.7, live=True)
    vertical: float = parameter(_SPEED, "largest speed, z", 0.4, live=True)
    yaw_dot: float = parameter(Number("rad/s", above=0.0), "largest yaw rate", 1.5, live=True)
    acceleration: float = parameter(
        Number("m/s^2", above=0.0), "largest acceleration, also when stopping", 1.0, live=True
    )
    min_height: float = parameter(Number("m"), "lowest height of the reference", 0.3, live=True)
    max_height: float = parameter(Number("m"), "largest height of the reference", 2.0, live=True)

    @override
    def complaints(self) -> Iterator[str]:
        if self.min_height > self.max_height:
            yield (
                f"limits/min_height is {self.min_height:g}; "
                f"expected <= limits/max_height, {self.max_height:g} (m)"
            )


class VelocityReference:
    """Integrates velocities, within limits."""

    def __init__(self, limits: LimitParameters, silence: float):
        self.limits = limits
        #: Age of the last velocity at which the reference stops (s).
        self.silence = silence
        self.pose: ReferencePose | None = None  #: None before the first `place`.
        self._velocity = Velocity()
        self._command = Velocity()
        self._command_time = -math.inf

    def place(self, x: float, y: float, z: float) -> None:
        """Start at rest at a position (m); the heading stays, or is 0."""
        self.pose = ReferencePose(x, y, z, 0.0 if self.pose is None else self.pose.yaw)
        self.stop()

    def stop(self) -> None:
        """Stop at once, and forget the commanded velocity."""
        self._velocity = Velocity()
        self._command = Velocity()

    def command(self, velocity: Velocity, time: float) -> None:
        """Set the velocity that was commanded at ``time`` (s)."""
        self._command = velocity
        self._command_time = time

    def is_commanded(self, time: float) -> bool:
        """Return whether a velocity has been commanded lately."""
        return 0.0 <= time - self._command_time <= self.silence

    def advance(self, dt: float, time: float) -> None:
        """Advance the reference by ``dt`` (s) to ``time`` (s)."""
        if self.pose is None:
            return
        self._velocity = self._approach(self._target(time), dt)
        v, pose = self._velocity, self.pose
        # The heading in the middle of the step is used, so that a circle closes.
        dx, dy = rotate_by_yaw(v.x * dt, v.y * dt, pose.yaw + v.yaw_dot * dt / 2.0)
        z = pose.z + v.z * dt
        # If a place outside the limits was given, the reference does not jump.
        lowest = min(self.limits.min_height, pose.z)
        highest = max(self.limits.max_height, pose.z)
        if not lowest <= z <= highest:
            z = min(max(z, lowest), highest)
            self._velocity = replace(v, z=0.0)
        self.pose = ReferencePose(
            pose.x + dx, pose.y + dy, z, wrap_to_pi(pose.yaw + v.yaw_dot * dt)
        )

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Velocity of the reference in the fixed frame, m/s."""
        v = self._velocity
        yaw = 0.0 if self.pose is None else self.pose.yaw
        return *rotate_by_yaw(v.x, v.y, yaw), v.z

    def _target(self, time):
        if not self.is_commanded(time):
            return Velocity()
        limits, command = self.limits, self._command
        speed = math.hypot(command.x, command.y)
        # The direction is kept.
        scale = min(1.0, limits.horizontal / speed) if speed > 0.0 else 1.0
        return Velocity(
            scale * command.x,
            scale * command.y,
            clamp(command.z, limits.vertical),
            clamp(command.yaw_dot, limits.yaw_dot),
        )

    def _approach(self, target, dt):
        v = self._velocity
        most = self.limits.acceleration * dt
        dx, dy = target.x - v.x, target.y - v.y
        change = math.hypot(dx, dy)
        part = min(1.0, most / change) if change > 0.0 else 1.0
        return Velocity(
            v.x + part * dx, v.y + part * dy, v.z + clamp(target.z - v.z, most), target.yaw_dot
        )


def clamp(value: float, most: float) -> float:
    """Return a value limited to [-most, most]."""
    return min(max(value, -most), most)
