"""A box that a vehicle does not leave: a control is changed only if it would lead out.

Each axis has two walls and a `viable_set.Axis`, the bounds within which the vehicle moves. The
fence predicts position, velocity and acceleration to the time at which the next control is in
force, from the measured state and the controls that have been sent. While any control leaves the
vehicle able to stop, the regular control passes. Otherwise each axis is given the nearest one that
does. What of it the vehicle cannot produce, tilt being limited and under the thrust, is given up on
the way to accelerations that it always can. docs/geofence_proof.md says why it holds.
"""

import math
from collections import deque
from collections.abc import Sequence

from crazyflie_geofence.disturbance import DisturbanceWatch
from crazyflie_geofence.obstacles import Obstacles, Plane, halfway
from crazyflie_geofence.viable_set import Axis, response
from crazyflie_model.angles import rotate_by_yaw
from crazyflie_model.dynamics import coupled_acceleration
from crazyflie_model.elementwise import clip
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.units import GRAVITY

#: Largest acceleration that a control can ask for, along any horizontal line and along z (m/s^2).
LARGEST_HORIZONTAL = math.sqrt(2.0) * MAX_THRUST * math.sin(MAX_TILT)
LARGEST_VERTICAL = MAX_THRUST - GRAVITY

#: A vehicle outside of the box comes back with this speed at most (m/s), slower on the last metre
#: (1/s), and changes its speed within this time (s).
RETURN_SPEED, RETURN_RATE, RETURN_TIME = 0.5, 1.0, 0.4

_HOVER = (0.0, 0.0, 0.0)  #: Accelerations of a vehicle that stands or hovers (m/s^2).
_MEMORY = 100  #: Controls that are remembered.
_ROUNDING = 1e-9  #: Of controls that are exactly at a limit.
_PROJECTIONS = 8  #: Rounds over walls and obstacles.
_HALVINGS = 20  #: Of the part of a control that the vehicle cannot produce.

Triple = tuple[float, float, float]
Control = Sequence[float]  #: roll and pitch (rad), yaw_dot (rad/s), thrust (m/s^2).


def max_horizontal_braking(vertical: float) -> float:
    """Return the acceleration along x and y at once, m/s^2, beside one down by ``vertical``.

    At any heading: the square of both tilts contains the square of the axes, turned, if that is
    smaller by the root of 2.
    """
    return (GRAVITY - vertical) * math.sin(MAX_TILT) / math.sqrt(2.0)


def max_vertical_braking(max_thrust: float) -> float:
    """Return the acceleration up and down under full roll and pitch, m/s^2."""
    return min(GRAVITY - MIN_THRUST, max_thrust * math.cos(MAX_TILT) ** 2 - GRAVITY)


class Geofence:
    """Prioritised controller that keeps a vehicle in a box.

    Parameters
    ----------
    lower, upper : sequence of float, 3
        Corners of the box, m, fixed frame.
    axes : sequence of Axis, 3
        Bounds of the vehicle along x, y and z.
    max_thrust : float
        Largest thrust over the mass that the fence's own controls ask for, m/s^2.
    obstacles : Obstacles
        What stands in the box.
    """

    def __init__(
        self,
        lower: Sequence[float],
        upper: Sequence[float],
        axes: Sequence[Axis],
        max_thrust: float = MAX_THRUST,
        obstacles: Obstacles | None = None,
    ):
        self._obstacles = obstacles or Obstacles((), 0.0)
        #: Positions of other vehicles (m), each of which has half of the room, and what is kept
        #: free of it (m).
        self.others: Sequence[Triple] = ()
        self.buffer = 0.0
        self._max_thrust = min(max_thrust, MAX_THRUST)
        # Towards the upper walls of the axes, then towards the lower ones (m/s^2).
        self._acceleration: Sequence[float] = [0.0] * 6
        self._in_force = [0.0] * 6  # Commanded ones.
        self._time: float | None = None  # Of the accelerations.
        self._new: deque[tuple[float, Control, float]] = deque(maxlen=_MEMORY)
        self._sent: deque[tuple[float, list[float]]] = deque()
        self._last: list[float] | None = None  # Accelerations of the fence's last control.
        self._watch = DisturbanceWatch()
        self.change(lower, upper, axes)

    def change(self, lower: Sequence[float], upper: Sequence[float], axes: Sequence[Axis]) -> None:
        """Set box and bounds; what has been sent remains known."""
        self._box, self._axes = (lower, upper), tuple(axes)
        self._watch.expect([axis.velocity_error for axis in axes])
        self._set_walls()

    def _set_walls(self):
        axes = [a.disturbed(d) for a, d in zip(self._axes, self._watch.widest, strict=True)]
        self._walls = tuple(zip(*self._box, axes, strict=True))

    def excess(self) -> list[tuple[str, float, float]]:
        """Return axis, disturbance (m/s^2) and its bound where it is larger than that."""
        watched = zip("xyz", self._watch.widest, self._axes, strict=True)
        return [(name, d, axis.disturbance) for name, d, axis in watched if d > axis.disturbance]

    def sent(self, time: float, control: Control, yaw: float) -> None:
        """Take a control that has been sent to the vehicle at ``time`` (s)."""
        self._new.append((time, control, yaw))

    def control(
        self, time: float, position: Triple, velocity: Triple, yaw: float, regular: Control
    ) -> tuple[Control, float]:
        """Return a control, and the priority with which it is to be mixed with the regular one.

        The priority is 0 while any control of the next period leaves the vehicle able to stop,
        otherwise 1. Position and velocity, m and m/s, are in the fixed frame, ``time`` (s) is that
        of their arrival, and the yaw is in rad.
        """
        self._catch_up(time)
        if self._watch.is_due(time):
            self._advance(time)
            self._watch.compare(time, velocity)
            self._set_walls()

        def place(plane):
            return self._axis(plane), plane.distance(position), -plane.along(velocity)

        planes = self._obstacles.choose(
            position,
            velocity,
            lambda plane: Axis.is_far(*place(plane)),
            lambda plane: self._room(plane, *place(plane)),
        )
        planes += [halfway(position, other, self.buffer) for other in self.others]
        # Towards the upper and the lower wall of each axis, and each plane: the bounds, the
        # distance and the velocity.
        places = [
            each
            for (low, high, axis), p, v in zip(self._walls, position, velocity, strict=True)
            for each in ((axis, high - p, v), (axis, p - low, -v))
        ] + [place(plane) for plane in planes]
        # Far from all walls, a prediction would change nothing.
        near = [not Axis.is_far(*each) for each in places]
        if not any(near):
            self._last = None
            return regular, 0.0
        self._advance(time)
        up_x, up_y, up_z, down_x, down_y, down_z = moves = self._predict(time, velocity)
        ways = [up_x, down_x, up_y, down_y, up_z, down_z]
        ways += [
            tuple(_along(plane, each) for each in zip(*moves, strict=True)) for plane in planes
        ]
        states = [
            (distance - way, v, a)
            for (_, distance, _), (way, v, a) in zip(places, ways, strict=True)
        ]
        if not any(
            is_near and not axis.is_free(*state)
            for is_near, (axis, _, _), state in zip(near, places, states, strict=True)
        ):
            self._last = None
            return regular, 0.0
        lasts: Sequence[float | None] = self._last or (None, None, None)
        walls = zip(self._walls, states[0:6:2], states[1:6:2], lasts, strict=True)
        ranges = [_range(axis, up, down, last) for (_, _, axis), up, down, last in walls]
        limits = [
            (plane, self._axis(plane).braking, self._most(plane, *each))
            for plane, each in zip(planes, states[6:], strict=True)
        ]
        wanted = _acceleration_of(regular, yaw)
        if _allowed(wanted, ranges, limits) == wanted:
            self._last = wanted
            return _limited(regular, MAX_THRUST), 1.0
        wanted = _acceleration_of(regular, yaw, self._max_thrust)
        nearest = _allowed(wanted, ranges, limits)
        safe = _allowed(_HOVER, ranges, limits)
        self._last = self._producible(safe, nearest, yaw)
        roll, pitch, thrust = _control(self._last, yaw)
        return _limited((roll, pitch, regular[2], thrust), self._max_thrust), 1.0

    def _axis(self, plane: Plane) -> Axis:
        """Return the bounds along a plane's normal: x has those of every horizontal line."""
        return self._walls[2 if plane.normal[2] else 0][2]

    def _room(self, plane, axis, distance, speed):
        """Return the distance between the stopping point and a plane, m, from now on."""
        return distance - axis.stopping_distance(speed, _along(plane, self._acceleration))

    def _most(self, plane, distance, v, a):
        """Return the largest acceleration towards a plane."""
        axis = self._axis(plane)
        if distance < -axis.position_margin:
            return _return(axis, distance, v)
        last = axis.largest if self._last is None else -plane.along(tuple(self._last))
        return axis.smooth_control(distance, v, a, last)

    def _catch_up(self, time):
        """Advance the accelerations to the last control that is in force at a time."""
        while self._new:
            sent, control, heading = self._new.popleft()
            # Below the thrust of flights the vehicle stands.
            flies = control[3] >= MIN_THRUST
            u = _acceleration_of(control, heading) if flies else _HOVER
            towards = zip((*u, *(-part for part in u)), self._axes * 2, strict=True)
            self._sent.append((sent, [max(part, -axis.braking) for part, axis in towards]))
            if not flies:
                self._watch.restart()
        if self._time is not None and time < self._time:
            # The clock has stepped back: what was sent belongs to another run.
            self._sent = deque(each for each in self._sent if each[0] <= time)
        delay = self._axes[0].delay
        while self._sent and self._sent[0][0] + delay <= time:
            begin, u = self._sent.popleft()
            self._advance(begin + delay)
            self._in_force = u

    def _advance(self, time):
        # A clock that has stepped back belongs to another run.
        elapsed = 0.0 if self._time is None else max(time - self._time, 0.0)
        self._time = time
        states = zip(self._responses(elapsed), self._acceleration, self._in_force, strict=True)
        moves = [r.moved(0.0, 0.0, a, u, 0.0) for r, a, u in states]
        _, gained, self._acceleration = zip(*moves, strict=True)
        self._watch.gain(gained)

    def _responses(self, duration):
        x, _, z = (axis.tau for axis in self._axes)
        horizontal, vertical = response(duration, x), response(duration, z)
        return (horizontal, horizontal, vertical) * 2

    def _predict(self, time, velocity):
        """Return the way, velocity and acceleration towards each wall at the end of the delay."""
        delay, in_force, start = self._axes[0].delay, self._in_force, time
        pieces = []
        for begin, following in self._sent:
            if begin > time:
                # Sent since: what answers the state replaces it.
                break
            pieces.append((self._responses(begin + delay - start), in_force))
            start, in_force = begin + delay, following
        pieces.append((self._responses(time + delay - start), in_force))
        moves = []
        for i, v in enumerate((*velocity, *(-v for v in velocity))):
            state = 0.0, v, self._acceleration[i]
            for responses, controls in pieces:
                state = responses[i].moved(*state, controls[i], 0.0)
            moves.append(state)
        return moves

    def _producible(self, safe, nearest, yaw):
        """Return the accelerations of a control nearest to ``nearest``, on the line to ``safe``."""
        if self._is_producible(nearest, yaw):
            return nearest
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            share = (low + high) / 2.0
            between = [a + share * (b - a) for a, b in zip(safe, nearest, strict=True)]
            if self._is_producible(between, yaw):
                low = share
            else:
                high = share
        return [a + low * (b - a) for a, b in zip(safe, nearest, strict=True)]

    def _is_producible(self, acceleration, yaw):
        roll, pitch, thrust = _control(acceleration, yaw)
        return (
            max(abs(roll), abs(pitch)) <= MAX_TILT + _ROUNDING
            and MIN_THRUST - _ROUNDING <= thrust <= self._max_thrust + _ROUNDING
        )


def _acceleration_of(control, yaw, max_thrust=MAX_THRUST):
    """Return the accelerations that a control asks for, within the limits of all vehicles."""
    return coupled_acceleration(_limited(control, max_thrust), yaw)


def _limited(control, max_thrust):
    roll, pitch, yaw_dot, thrust = control
    return (
        clip(roll, -MAX_TILT, MAX_TILT),
        clip(pitch, -MAX_TILT, MAX_TILT),
        yaw_dot,
        clip(thrust, MIN_THRUST, max_thrust),
    )


def _along(plane, towards):
    """Return the part towards a plane of what is known towards each of the six walls."""
    return sum(
        abs(part) * towards[i if part < 0.0 else i + 3] for i, part in enumerate(plane.normal)
    )


def _allowed(wanted, ranges, limits):
    """Return the accelerations nearest to those that are wanted, within ranges and limits.

    Projected in turn (Kaczmarz, 1937). Those of the walls come last: where both cannot be obeyed,
    the vehicle stays in the box.
    """
    u = [clip(w, low, high) for w, (low, high) in zip(wanted, ranges, strict=True)]
    for plane, braking, most in limits:
        ranges = [
            _capped(each, n, most + braking * (sum(map(abs, plane.normal)) - abs(n)))
            for each, n in zip(ranges, plane.normal, strict=True)
        ]
    for _ in range(_PROJECTIONS if limits else 0):
        for plane, _, most in limits:
            excess = max(-plane.along(tuple(u)) - most, 0.0)
            u = [part + excess * n for part, n in zip(u, plane.normal, strict=True)]
        u = [clip(w, low, high) for w, (low, high) in zip(u, ranges, strict=True)]
    return u


def _capped(limits, normal, most):
    """Return a range in which the part towards a plane is at most ``most``.

    Of an acceleration away from the plane along the other axis, the vehicle may have no more than
    the braking: one along this axis must not need more. Inside of the range that is given.
    """
    low, high = limits
    if normal < 0.0:
        return low, max(min(high, -most / normal), low)
    return (min(max(low, -most / normal), high) if normal else low), high


def _range(axis, up, down, last):
    """Return the smallest and the largest acceleration that both walls allow."""
    most = axis.largest
    if up[0] < -axis.position_margin:
        return -most, _return(axis, *up[:2])
    if down[0] < -axis.position_margin:
        return -_return(axis, *down[:2]), most
    return axis.control_range(up, down, (-most, most) if last is None else (last, last))


def _return(axis, distance, v):
    """Return the largest acceleration of a vehicle that is outside."""
    speed = min(RETURN_SPEED, -distance * RETURN_RATE)
    return clip((-speed - v) / RETURN_TIME, -axis.braking, axis.braking)


def _control(acceleration, yaw):
    """Return roll, pitch and thrust, the inverse of `coupled_acceleration`.

    With T sin(pitch) = forward, -T sin(roll) = left and T cos(roll) cos(pitch) = up + g, the square
    of T is the larger root of T^4 - (forward^2 + left^2 + (up + g)^2) T^2 + forward^2 left^2.
    """
    x, y, z = acceleration
    forward, left = rotate_by_yaw(x, y, -yaw)
    squares = forward**2 + left**2 + (GRAVITY + z) ** 2
    root = math.sqrt(max(squares**2 - 4.0 * (forward * left) ** 2, 0.0))
    thrust = max(math.sqrt((squares + root) / 2.0), 1e-9)
    roll = math.asin(clip(-left / thrust, -1.0, 1.0))
    return roll, math.asin(clip(forward / thrust, -1.0, 1.0)), thrust
