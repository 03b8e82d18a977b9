"""Invariants of every step of a soak, whatever fails."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from crazyflie_model.limits import OFF_AGE
from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.fallback import SINK_SPEED
from crazyflie_takeoff.phases import flight_state
from crazyflie_utils.testing import FakeGraph

MOST_THRUST = 16.0  #: Limit of a final control (m/s^2): that of the controller.
MOST_TILT = math.radians(15.1)  #: Limit of a final control (rad): that of the controller.
OVERSHOOT = 0.2  #: Largest height of a vehicle above its highest reference (m).

#: The same while all nodes stop for up to 0.6 s: a first stop in a climb at full thrust, of 6.2
#: m/s^2, comes without warning and makes 1.1 m, and ending that climb with 4 m/s^2 1.7 m, less what
#: was still to be climbed.
STARVED_OVERSHOOT = 2.5

#: Longest time in the air without a good pose (s): 1.6 s in which the pose may come back, 5 s of
#: descent and the fall after it; the descent at `SINK_SPEED` is added.
BLIND_LIMIT = 8.0

#: Horizontal acceleration of a vehicle that tilts about both axes as far as it may (m/s^2).
_ACCELERATION = math.hypot(1.0, 1.0) * GRAVITY * math.tan(MOST_TILT)
#: Longest way from rest (m): a reference is at most that far away (`reference/max_jump`). A vehicle
#: accelerates over half of it, and so becomes as fast as the root of way times acceleration.
_WAY = 3.0
_JUMP = 0.5  #: Least distance between two references of which the second is a new one (m).

#: Largest distance from the middle in a flight that begins there (m): the models of 7 states have
#: no drag, and keep their speed while they descend without poses.
FLY_AWAY = 8.0

#: Most speed at which it may meet the ground unless its motors were switched off, m/s.
HARD_LANDING = 2.0
_AIRBORNE = 0.05  #: Height from which on a vehicle is in the air, m.

_LEGAL = {
    # A takeoff that is aborted at once is never published.
    "on_ground": {"taking_off", "landing"},
    "taking_off": {"flying", "descending", "landing", "on_ground"},
    "flying": {"descending", "landing", "on_ground"},
    "descending": {"landing", "on_ground", "flying"},
    # The ground may be lower than where the vehicle took off.
    "landing": {"on_ground", "descending"},
}


@dataclass
class Watch:
    """Compares everything that happens with what has to hold."""

    graph: FakeGraph
    violations: list[str] = field(default_factory=list)  #: With the time of each.
    highest: float = -math.inf  #: Largest height above the highest reference (m).
    hardest: float = 0.0  #: Speed at which the ground was met with motors on, m/s.
    farthest: float = 0.0  #: Largest distance from the middle in the air (m).
    is_calm: bool = False  #: Whether nothing has failed in this flight.
    is_blind: bool = False  #: Whether a fault keeps good poses away.
    may_fly: bool = False  #: Whether a takeoff has been asked for since the last landing.
    may_fall: bool = False  #: Whether the vehicle may meet the ground at any speed.
    is_emergency: bool = False  #: Whether motors have to stand still.
    is_starved: bool = False  #: Whether all nodes have stopped again and again in this flight.
    height: float = 0.0  #: Height of the vehicle now (m).
    distance: float = 0.0  #: Distance from the middle now (m).
    state: str = ""  #: State of the flight, as the server publishes it.
    _reference: float = 0.0
    _velocity: tuple[float, ...] = (0.0, 0.0, 0.0)
    _goal: tuple[float, ...] = (math.inf, math.inf, math.inf)  #: Position of the last reference.
    _way: float = _WAY  #: Longest way that a reference has made in this flight (m).
    _blind_since: float = math.inf
    _last: tuple[float, tuple[float, ...], float] | None = None
    _climb: float = 0.0
    _deaf_height: float = 0.0  #: Highest place to which the last control alone leads, m.
    _said: set[str] = field(default_factory=set)

    def begin(self) -> None:
        """Begin to listen."""
        self.graph.listen("/tf", self._on_tf)
        self.graph.listen("/ref", self._on_reference)
        self.graph.listen("/control/final", self._on_control)
        self.graph.listen("/in_flight_flight_status", self._on_status)

    def renew(self) -> None:
        """Begin another flight."""
        self._said.clear()
        self._reference, self._way = 0.0, _WAY
        self.is_starved = False
        self.is_calm = True

    def allow(self, height: float) -> None:
        """Allow the vehicle to be at a reference's height (m)."""
        self._reference = max(self._reference, height)

    def carried(self) -> None:
        """Forget the last position: the vehicle has been put elsewhere."""
        self._last = None

    def check(self, is_good: bool, text: str) -> None:
        """Record a violation unless something is good; the same one once in a flight."""
        kind = text.split(":")[0]
        if not is_good and kind not in self._said:
            self._said.add(kind)
            self.violations.append(f"{self.graph.time:.2f} s: {text}")

    def _on_tf(self, message):
        time = self.graph.time
        transform = message.transforms[0]
        translation = transform.transform.translation
        position = (translation.x, translation.y, translation.z)
        stamp = transform.header.stamp.to_sec()
        before, self._last = self._last, (time, position, stamp)
        if before is None or time <= before[0]:
            return
        # Poses come closer together than they were measured where their latency is changed; the
        # clock of their stamps may be set.
        elapsed = max(time - before[0], stamp - before[2])
        height = self.height = position[2]
        self.distance = math.hypot(*position[:2])
        is_airborne = height > _AIRBORNE
        self._velocity = tuple((b - a) / elapsed for a, b in zip(before[1], position, strict=True))
        speed, most_speed = math.hypot(*self._velocity), math.sqrt(self._way * _ACCELERATION)
        self.highest = max(self.highest, height - self._reference)
        if is_airborne:
            # The ground of the models of 7 states has no friction.
            self.farthest = max(self.farthest, self.distance)
        if height <= 0.001 < before[1][2] and not self.may_fall:
            self.hardest = max(self.hardest, -self._climb)
            self.check(-self._climb <= HARD_LANDING, f"hard landing: {-self._climb:.2f} m/s")
        self._climb = (height - before[1][2]) / elapsed
        most = self._reference + (STARVED_OVERSHOOT if self.is_starved else OVERSHOOT)
        if self.may_fall:
            most = max(most, self._deaf_height)
        limits = f"{height:.2f} m, reference {self._reference:.2f} m"
        self.check(height <= most or not self.may_fly, f"too high: {limits}")
        self.check(height <= 0.1 or self.may_fly, f"in the air unasked: {height:.2f} m")
        far = self.distance > FLY_AWAY and is_airborne
        self.check(not far, f"flown away: {self.distance:.2f} m")
        self.check(speed <= most_speed or self.may_fall, f"too fast: {speed:.2f} m/s")
        if not (self.is_blind and is_airborne):
            self._blind_since = time
        blind = time - self._blind_since
        limit = BLIND_LIMIT + self._reference / SINK_SPEED
        self.check(blind <= limit, f"in the air without a pose: for {blind:.1f} s")

    def _on_reference(self, message):
        """Allow for the braking distance after a jump of the reference."""
        goal = (message.state.x, message.state.y, message.state.z)
        if self._last is not None and not math.dist(goal, self._goal) < _JUMP:
            offset = [b - a for a, b in zip(self._last[1], goal, strict=True)]
            ahead = sum(a * b for a, b in zip(self._velocity, offset, strict=True))
            # Towards the reference or away from it; one that is not finite has no direction.
            speed = ahead / (math.hypot(*offset) or 1.0)
            self._way = max(self._way, _WAY + speed**2 / (2.0 * _ACCELERATION))
        self._goal = goal

    def _on_control(self, message):
        control = message.control
        thrust, tilt = control.thrust, max(abs(control.roll), abs(control.pitch))
        numbers = (control.roll, control.pitch, control.yaw_dot, thrust)
        self.check(all(map(math.isfinite, numbers)), f"control is not finite: {numbers}")
        self.check(0.0 <= thrust <= MOST_THRUST, f"thrust out of limits: {thrust:.2f} m/s^2")
        self.check(tilt <= MOST_TILT, f"tilt out of limits: {tilt:.2f} rad")
        is_still = thrust <= 0.0 or not self.is_emergency
        self.check(is_still, f"thrust in emergency: {thrust:.2f} m/s^2")
        self._deaf_height = self.height + _rise(self._climb, thrust - GRAVITY) + OVERSHOOT
        is_asked = thrust <= 1.2 * GRAVITY or self.may_fly
        self.check(is_asked, f"thrust without a takeoff: {thrust:.2f} m/s^2")

    def _on_status(self, message):
        state = flight_state(message.state)
        before, self.state = self.state, "" if state is None else state.word
        is_legal = not before or self.state == before or self.state in _LEGAL.get(before, ())
        self.check(is_legal, f"flight state went from {before} to {self.state}")


def _rise(climb, acceleration):
    """Return how far a vehicle rises (m) with the last thrust, which the firmware keeps."""
    final = climb + acceleration * OFF_AGE
    if final > 0.0:
        # One that sinks first may not come up to where it was.
        return max((climb + final) / 2.0 * OFF_AGE + final**2 / (2.0 * GRAVITY), 0.0)
    return climb**2 / (-2.0 * acceleration) if climb > 0.0 else 0.0
