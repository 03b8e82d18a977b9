"""The set of states that can stop before a wall: its closed form, and the theorem's steps."""

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from crazyflie_geofence import bounds
from crazyflie_geofence.viable_set import Axis, response

AXIS = Axis(
    tau=0.12,
    braking=1.3,
    largest=5.86,
    disturbance=0.5,
    position_error=0.002,
    velocity_error=0.05,
    delay=0.02,
    spread=0.01,
    period=0.01,
)
EXACT = replace(AXIS, position_error=0.0, velocity_error=0.0, delay=0.0, spread=0.0, period=0.0)
SPEED, ACCELERATION = st.floats(-4.0, 4.0), st.floats(-5.86, 5.86)
UNIT = st.floats(-1.0, 1.0)
#: Distances are computed to this (m).
EXACTNESS = 1e-6


@st.composite
def axes(draw):
    """Return bounds of any vehicle."""
    braking = draw(st.floats(0.3, 5.0))
    return Axis(
        tau=draw(st.floats(0.005, 0.4)),
        braking=braking,
        largest=braking * draw(st.floats(1.0, 4.0)),
        disturbance=braking * draw(st.floats(0.0, 0.9)),
        position_error=draw(st.floats(0.0, 0.05)),
        velocity_error=draw(st.floats(0.0, 0.2)),
        delay=draw(st.floats(0.0, 0.1)),
        spread=draw(st.floats(0.0, 0.03)),
        period=draw(st.floats(0.001, 0.03)),
    )


def moved(axis, state, u, d, time):
    """Return position, velocity and acceleration after a time of control and disturbance."""
    return response(time, axis.tau).moved(*state, u, d)


def stop(axis, state):
    p, v, a = state
    return p + axis.stopping_distance(v, a)


@given(axes(), SPEED, ACCELERATION)
def test_the_distance_is_that_of_a_vehicle_that_brakes(axis, v, a):
    end = 2.0 * (abs(v) + (abs(a) + axis.braking) * axis.tau) / (axis.braking - axis.disturbance)
    times = np.linspace(0.0, end, 4001)
    a = max(a, -axis.braking)  # Stronger braking than that is not counted on.
    ways = [moved(axis, (0.0, v, a), -axis.braking, axis.disturbance, float(t))[0] for t in times]
    step = end / 4000.0
    # Between two of these times the way bends by at most half the acceleration times step^2 / 4.
    bend = (abs(a) + axis.braking + axis.disturbance) * step**2 / 8.0
    distance = axis.stopping_distance(v, a)
    assert max(ways) - EXACTNESS <= distance <= max(ways) + bend + EXACTNESS


@given(axes(), SPEED, ACCELERATION, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_distance_grows_with_velocity_and_acceleration(axis, v, a, more_v, more_a):
    more = axis.stopping_distance(v + more_v, a + more_a)
    assert more >= axis.stopping_distance(v, a) - EXACTNESS


@given(axes(), SPEED, ACCELERATION, UNIT, st.floats(0.0, 3.0))
def test_braking_never_moves_the_stopping_point_outwards(axis, v, a, d, time):
    """The theorem's first step: the set of states is kept by full braking, whatever d is."""
    before = stop(axis, (0.0, v, a))
    after = moved(axis, (0.0, v, a), -axis.braking, d * axis.disturbance, time)
    assert stop(axis, after) <= before + EXACTNESS


@given(axes(), SPEED, ACCELERATION, UNIT, UNIT, st.floats(0.01, 3.0))
def test_the_largest_control_is_safe_and_a_larger_one_is_not(axis, v, a, last, more, room):
    last *= axis.largest
    u = axis.largest_control(room, v, a, last)
    assert -axis.braking <= u <= axis.largest
    inside = room - axis.position_margin - axis.bulge
    speed = v + axis.velocity_margin
    if u > -axis.braking:
        assert axis.reach(speed, a, max(last, u), u) <= inside
    if u < axis.largest:
        larger = u + (axis.braking + axis.largest) * (0.2 + abs(more))
        assert axis.reach(speed, a, max(last, larger), larger) > max(inside, -axis.bulge)


@given(axes(), SPEED, ACCELERATION, st.floats(0.0, 6.0))
def test_a_vehicle_that_is_far_from_the_wall_is_free(axis, v, a, room):
    a = min(max(a, -axis.largest), axis.largest)
    if axis.is_free(room, v, a):
        assert axis.largest_control(room, v, a, axis.largest) == axis.largest
    # Whatever has been sent, the delay cannot move it further than this.
    later = moved(axis, (0.0, v, a), axis.largest, 0.0, axis.delay)
    if axis.is_far(room, v):
        assert axis.is_free(room - later[0], later[1], later[2])


def test_arrays_and_floats_have_the_same_answers():
    random = np.random.default_rng(1)
    v, a, last = random.uniform(-3.0, 3.0, (3, 200))
    room = random.uniform(0.0, 2.0, 200)
    many = AXIS.largest_control(room, v, a, last)
    each = [AXIS.largest_control(*map(float, one)) for one in zip(room, v, a, last, strict=True)]
    np.testing.assert_allclose(many, each, atol=1e-6)


@given(axes(), UNIT, st.integers(0, 2**32 - 1))
def test_in_the_smallest_box_the_walls_never_ask_for_contrary_controls(axis, last, seed):
    """Among states that both walls allow, measured with any errors."""
    random, n = np.random.default_rng(seed), 3000
    width, last = axis.smallest_box, last * axis.largest
    reach = math.sqrt(2.0 * axis.braking * width) + axis.largest * axis.tau
    v = random.uniform(-1.0, 1.0, n) * reach * random.random(n)
    a = random.uniform(-1.0, 1.0, n) * axis.largest
    # What the upper wall has to expect beside what the lower one has.
    more = random.uniform(0.0, 1.0, n) * (axis.largest - axis.braking)
    most = np.minimum(a + more, axis.largest)
    # The first half touches one of the walls' sets.
    up, down = axis.stopping_distance(v, most), axis.stopping_distance(-v, -a)
    p = random.uniform(0.0, width, n)
    p[: n // 2] = np.where(random.random(n // 2) < 0.5, (width - up)[: n // 2], down[: n // 2])
    viable = (p + up <= width) & (p - down >= 0.0)
    p, v, a, most = p[viable], v[viable], a[viable], most[viable]
    shown = p + axis.position_margin * random.choice([-1.0, 1.0], len(p))
    speed = v + axis.velocity_margin * random.choice([-1.0, 1.0], len(p))
    before = np.full(len(p), last)
    largest = axis.largest_control(width - shown, speed, most, before)
    smallest = -axis.largest_control(shown, -speed, -a, -before)
    resolution = 1e-6
    assert np.all(smallest <= largest + resolution)


@given(axes(), st.floats(0.0, 2.0), SPEED, UNIT, UNIT)
def test_the_smooth_control_is_safe_and_that_of_before_where_it_can_be(axis, room, v, a, last):
    state = room, v, a * axis.largest, last * axis.largest
    held, safe = axis.largest_control(*state, axis.smooth_hold), axis.largest_control(*state)
    smooth = axis.smooth_control(*state)
    assert held <= smooth <= max(safe, held)
    assert smooth == held or smooth == min(safe, state[-1])


def test_a_little_noise_changes_no_control():
    """1 mm/s changes what is safe by 0.06 m/s^2."""
    found = {AXIS.smooth_control(0.25, 0.4 + noise, 0.0, 0.3) for noise in (-1e-3, 0.0, 1e-3)}
    assert found == {0.3}


# Edges of the level set V >= 0 of hj-reachability 0.7 ("very_high" accuracy, 29 x 161 x 81 points,
# 2.5 s), by hj_level_set.py: velocity, acceleration, largest position that is viable. It is less by
# up to 0.7 mm; with 81 x 41 velocities and accelerations by 5 mm.
HJ = {"tau": 0.15, "braking": 1.3, "disturbance": 0.3, "wall": 0.6}
HJ_EDGES = [
    (-0.38, -1.05, 0.6),
    (-0.38, 1.05, 0.6),
    (0.0, -1.05, 0.59996),
    (0.0, 0.0, 0.59927),
    (0.0, 1.05, 0.58459),
    (0.38, -1.05, 0.51778),
    (0.38, 0.0, 0.46292),
    (0.38, 1.05, 0.38379),
    (0.76, -1.05, 0.28715),
    (0.76, 0.0, 0.17274),
    (0.76, 1.05, 0.03354),
    (1.14, -1.05, -0.08833),
    (1.14, 0.0, -0.26247),
    (1.14, 1.05, -0.46116),
]


def hj_axis():
    limits = {"braking": HJ["braking"], "largest": HJ["braking"]}
    return replace(EXACT, tau=HJ["tau"], disturbance=HJ["disturbance"], **limits)


@pytest.mark.parametrize(("v", "a", "edge"), HJ_EDGES)
def test_the_set_is_that_of_hamilton_jacobi_reachability(v, a, edge):
    own = HJ["wall"] - hj_axis().stopping_distance(v, a)
    assert edge - 1e-4 <= own <= edge + 1e-3


def predicted(axis, room, v, a, u, time):
    """Return distance from the wall, velocity and acceleration after the worst disturbance."""
    way, v, a = moved(axis, (0.0, v, a), u, axis.disturbance, time)
    return room - way, v, a


def kept_and_viable(axis, wall, stop, n=100_000):
    """Return which of n measured states between walls at +-``wall`` the fence, and any, keeps.

    The fence keeps those in which it does not brake fully. A state cannot be kept if its errors may
    hide one whose stopping point, by ``stop(v, a)``, is beyond a wall when the next control comes
    into force, at the latest. Also returns which could be kept without errors and delay.
    """
    random = np.random.default_rng(2)
    fastest = math.sqrt(4.0 * (axis.braking - axis.disturbance) * wall)
    p, v, a, u = random.uniform(-1.0, 1.0, (4, n)) * np.array(
        [[wall], [fastest], [axis.braking], [axis.braking]]
    )
    kept, viable, ideal = np.ones((3, n), dtype=bool)
    for sign in (1.0, -1.0):
        room, speed, acceleration, sent = wall - sign * p, sign * v, sign * a, sign * u
        ideal &= stop(speed, acceleration) <= room
        worst = room - axis.position_error, speed + axis.velocity_error, acceleration
        room_then, *rest = predicted(axis, *worst, sent, axis.delay)
        # A vehicle that was in the set is not outside.
        inside = np.maximum(room_then, 0.0), *rest
        left, *rest = predicted(axis, *inside, sent, axis.spread)
        viable &= stop(*rest) <= left
        calm = replace(axis, disturbance=0.0)
        shown = predicted(calm, room, speed, acceleration, sent, axis.delay)
        kept &= axis.largest_control(*shown, sent) > -axis.braking
    return kept, viable, ideal


@pytest.mark.parametrize("axis", bounds.axes(bounds.load("cf21"), 1.4, 2.0)[1:])
def test_it_keeps_all_that_errors_delay_and_lateness_leave(axis):
    kept, viable, ideal = kept_and_viable(axis, 1.5, axis.stopping_distance)
    assert not np.any(kept & ~viable)
    assert kept.sum() > 0.999 * viable.sum()
    # What no controller keeps that measures and acts as is assumed.
    assert 0.9 * ideal.sum() < viable.sum() < 0.95 * ideal.sum()


@pytest.mark.long  # The quick ones are those of HJ_EDGES, and of errors, delay and lateness.
def test_the_volume_is_that_of_a_level_set(tmp_path):
    """Computed by hj-reachability in an environment of its own, for which JAX is downloaded.

    Its level set is too small, by its grid: what the fence keeps beside it goes with the grid.
    """
    python, found = tmp_path / "venv" / "bin" / "python", tmp_path / "set.npz"
    program = Path(__file__).with_name("hj_level_set.py")
    for command in (
        [sys.executable, "-m", "venv", tmp_path / "venv"],
        [python, "-m", "pip", "install", "--quiet", "hj-reachability==0.7.0"],
    ):
        subprocess.run(command, check=True, timeout=1800.0)
    errors = ("position_error", "velocity_error", "delay", "spread", "period")
    axis = replace(hj_axis(), **{name: getattr(AXIS, name) for name in errors})
    _, _, exact = kept_and_viable(axis, HJ["wall"], axis.stopping_distance)
    shares = []
    for points in ("101", "161"):
        command = [python, program, found, *map(str, HJ.values()), points]
        subprocess.run(command, check=True, timeout=1800.0)
        level_set = np.load(found)
        grid = level_set["velocities"], level_set["accelerations"]
        edges = np.nan_to_num(level_set["edges"], nan=-math.inf)
        edge = RegularGridInterpolator(grid, edges, bounds_error=False, fill_value=-math.inf)
        kept, viable, ideal = kept_and_viable(
            axis, HJ["wall"], lambda v, a, edge=edge: HJ["wall"] - edge((v, a))
        )
        shares.append((exact.sum() / ideal.sum(), kept.sum() / viable.sum()))
    for coarse, fine in zip(*shares, strict=True):
        assert 0.98 < fine < 1.003
        assert fine - 1.0 < (coarse - 1.0) / 1.5
