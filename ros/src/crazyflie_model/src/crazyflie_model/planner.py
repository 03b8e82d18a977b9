"""Moves to a point: those of the firmware's high-level commander, and of a fleet's vehicles."""

import cmath
import math

from crazyflie_model.angles import Triple
from crazyflie_model.polynomials import Goal, PolynomialPiece, at_rest, hermite, shifted

MAX_SPEED = 2.0  #: Peak speed of a limited move (m/s): the default gains follow it.
#: Peak acceleration of a limited move (m/s^2): controllers tilt by 15 degrees at most, which is 2.6
#: m/s^2.
MAX_ACCELERATION = 2.0

#: Peak speed and acceleration of `smooth_piece` from rest, over distance / duration and distance /
#: duration^2.
SMOOTH_SPEED = 35.0 / 16.0
SMOOTH_ACCELERATION = 16.8 / math.sqrt(5.0)

_PEAK_BRAKING = 3.94  #: Peak acceleration of the braking in `move`, over speed / duration.
_MIN_BRAKING_TIME = 1.0  #: Shortest duration of the braking (s).


def move(
    start: Goal[float], position: Triple, yaw: float, duration: float
) -> list[PolynomialPiece]:
    """Return pieces from a goal to rest at a position (m) and heading (rad).

    They are `smooth_piece` from rest. If the start moves, the polynomial of the 5th degree that
    begins with its velocity and acceleration, and ends after `braking_time` where it began, at
    rest, is added: the distance that braking takes does not depend on the duration (s, > 0).
    """
    path = smooth_piece(at_rest(start.position, start.yaw), position, yaw, duration)
    rates = (*start.velocity, start.yaw_rate)
    changes = (*start.acceleration, 0.0)
    if not any(rates) and not any(changes):
        return [path]
    braking = max(braking_time(math.hypot(*start.velocity)), _MIN_BRAKING_TIME)
    braking = min(braking, duration)
    axes = []
    for axis, rate, change in zip(path.axes, rates, changes, strict=True):
        brake = (*hermite((0.0, rate, change), (0.0, 0.0, 0.0), braking), 0.0, 0.0)
        axes.append([a + b for a, b in zip(axis, brake, strict=True)])
    first = PolynomialPiece(braking, *axes)
    if braking == duration:
        return [first]
    rest = (shifted(axis, braking) for axis in path.axes)
    return [first, PolynomialPiece(duration - braking, *rest)]


def braking_time(speed: float) -> float:
    """Return the time in which a limited move brakes a speed (m/s), s.

    Braking has half of `MAX_ACCELERATION`.
    """
    return _PEAK_BRAKING * speed / (MAX_ACCELERATION / 2.0)


def shortest_duration(distance: float, speed: float = 0.0) -> float:
    """Return the shortest duration of a limited move over a distance (m), s.

    If it begins at a speed (m/s), braking has half of the acceleration, and half of the peak speed
    if it needs it.
    """
    acceleration = MAX_ACCELERATION if speed == 0.0 else MAX_ACCELERATION / 2.0
    by_acceleration = math.sqrt(SMOOTH_ACCELERATION * distance / acceleration)
    by_speed = SMOOTH_SPEED * distance / (MAX_SPEED - min(speed, MAX_SPEED / 2.0))
    return max(by_speed, by_acceleration, braking_time(speed))


def smooth_piece(
    start: Goal[float], position: Triple, yaw: float, duration: float
) -> PolynomialPiece:
    """Return the piece from a goal to rest at a position (m) and heading (rad).

    Each axis is the polynomial of the 7th degree that meets position, velocity, acceleration and
    jerk (zero) at both ends, heading without acceleration. From rest to rest this is 35 s^4 - 84
    s^5 + 70 s^6 - 20 s^7 of the way. The turn is the shorter one; ``duration`` is in s, > 0.
    """
    turn = math.remainder(yaw - start.yaw, 2.0 * math.pi)
    axes = [
        hermite((p, v, a, 0.0), (end, 0.0, 0.0, 0.0), duration)
        for p, v, a, end in zip(
            (*start.position, start.yaw),
            (*start.velocity, start.yaw_rate),
            (*start.acceleration, 0.0),
            (*position, start.yaw + turn),
            strict=True,
        )
    ]
    return PolynomialPiece(duration, *axes)


def straight_piece(
    start: Goal[float], position: Triple, yaw: float, duration: float
) -> PolynomialPiece:
    """Return the piece to a position and heading at constant speed; see `smooth_piece`."""
    turn = math.remainder(yaw - start.yaw, 2.0 * math.pi)
    ends = (*position, start.yaw + turn)
    starts = (*start.position, start.yaw)
    axes = ((a, (b - a) / duration) for a, b in zip(starts, ends, strict=True))
    return PolynomialPiece(duration, *axes)


def spiral_piece(
    start: Goal[float],
    angle: float,
    radii: tuple[float, float],
    ascent: float,
    duration: float,
    sideways: bool,
    clockwise: bool,
) -> PolynomialPiece:
    """Return the piece that approximates a spiral about a vertical axis.

    On the spiral, angle, radius, height and heading change evenly. Each axis is the polynomial of
    the 7th degree that meets its position, velocity and acceleration at both ends, without jerk:
    close up to a quarter of a turn, and not far beyond.

    Position and heading of the start determine the axis; ``angle`` is in rad, negative to fly
    backwards; ``radii`` are the distances from the axis at both ends, m; ``ascent`` is in m,
    ``duration`` in s, > 0. ``sideways`` is with the axis ahead or behind, and not to the side;
    ``clockwise`` is seen from above: then the axis is to the right or ahead, otherwise to the left
    or behind.
    """
    sense = -1.0 if clockwise else 1.0
    rate = sense * angle / duration
    # Direction from the axis to the vehicle. In the horizontal plane, (x, y) is x + iy.
    direction = start.yaw - sense * math.pi / 2.0 + (math.pi / 2.0 if sideways else 0.0)
    growth = (radii[1] - radii[0]) / duration
    x, y, z = start.position
    center = complex(x, y) - cmath.rect(radii[0], direction)

    def end(time):
        # Value, velocity, acceleration and jerk of each axis.
        radius, outward = radii[0] + growth * time, cmath.rect(1.0, direction + rate * time)
        plane = (
            center + radius * outward,
            (growth + 1j * radius * rate) * outward,
            (2j * growth * rate - radius * rate**2) * outward,
            0j,
        )
        return (
            [each.real for each in plane],
            [each.imag for each in plane],
            (z + ascent * time / duration, ascent / duration, 0.0, 0.0),
            (start.yaw + rate * time, rate, 0.0, 0.0),
        )

    axes = (hermite(a, b, duration) for a, b in zip(end(0.0), end(duration), strict=True))
    return PolynomialPiece(duration, *axes)
