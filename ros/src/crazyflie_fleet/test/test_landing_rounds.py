"""Which vehicles land next, and where: none comes down on another."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import pdist, squareform

from crazyflie_fleet.landing_rounds import MAX_DETOUR, Scene

SCALE = np.array([1.0, 1.0, 0.5])


def landing_place(i, places, is_down, limits):
    """Return where vehicle i lands, which descends already."""
    return Scene(places, np.arange(len(places)) == i, is_down, limits).landing_place(i)


def rounds(places, limit=0.3, half_width=np.inf, lands=None):
    """Land in rounds; return the rounds, and the least distance that two vehicles had, m.

    All of a round fly to their places at the same time, and then come down at any speed.
    """
    places = np.array(places, dtype=float)
    n = len(places)
    lands = np.ones(n, dtype=bool) if lands is None else np.array(lands)
    stands = places[:, 2] == 0.0
    lands &= ~stands
    lower, upper = np.full((n, 2), -half_width), np.full((n, 2), half_width)
    found, least = [], np.inf
    while lands.any():
        chosen = Scene(places, lands, stands, np.full((n, n), limit), lower, upper).next_round()
        assert chosen
        assert lands[[*chosen]].all()
        numbers = [*chosen]
        begin, goal = places[numbers, :2].copy(), np.array([*chosen.values()])
        for s in np.linspace(0.0, 1.0, 41):
            places[numbers, :2] = begin + s * (goal - begin)
            least = min(least, distance(places))
        # Coming down, each may be at any height, those on the ground do not move any more.
        columns = places[numbers]
        for number, column in zip(numbers, columns, strict=True):
            for j in set(range(n)) - {number}:
                apart = np.linalg.norm(places[j, :2] - column[:2])
                above = 0.0 if j in numbers else max(places[j, 2] - column[2], 0.0)
                least = min(least, np.hypot(apart, 0.5 * above))
        places[numbers, 2] = 0.0
        lands[numbers], stands[numbers] = False, True
        found.append({k: (*places[k, :2].round(3).tolist(),) for k in numbers})
    return found, least


def distance(places):
    return min(pdist(places * SCALE), default=np.inf)


def test_vehicles_side_by_side_land_where_they_are_at_the_same_time():
    found, _ = rounds([(0, 0, 1), (0.3, 0, 2), (0, 5, 0.4)])
    assert found == [{0: (0, 0), 1: (0.3, 0), 2: (0, 5)}]


def test_a_vehicle_above_another_lands_beside_it_and_after_it():
    found, least = rounds([(0, 0, 2), (0, 0, 1)])
    assert [[*each] for each in found] == [[1], [0]]
    assert found[0] == {1: (0, 0)}
    assert least >= 0.3
    assert np.hypot(*found[1][0]) < 0.6


def test_a_vehicle_that_hovers_is_not_landed_on():
    found, least = rounds([(0, 0, 2), (0, 0, 1)], lands=[True, False])
    assert [[*each] for each in found] == [[0]]
    assert least >= 0.3


def test_a_vehicle_on_the_ground_is_not_landed_on():
    (found,), least = rounds([(0, 0, 2), (0.1, 0, 0)])
    assert np.hypot(found[0][0] - 0.1, found[0][1]) >= 0.3
    assert least >= 0.3


def test_a_lattice_lands_layer_by_layer():
    axis = 0.7 * np.arange(3)
    layers = 1.4 * np.arange(3) + 1.0
    lattice = np.stack(np.meshgrid(axis, axis, layers), axis=-1).reshape(-1, 3)
    found, least = rounds(lattice)
    assert [len(each) for each in found] == [9, 9, 9]
    assert least >= 0.3


def test_free_places_are_within_the_box():
    found, least = rounds([(0, 0, 1 + k) for k in range(4)], half_width=0.5)
    assert all(max(map(abs, place)) <= 0.5 for each in found for place in each.values())
    assert least >= 0.3


def test_without_a_free_place_each_lands_where_it_is():
    found, _ = rounds([(0, 0, 1), (0, 0, 2)], half_width=0.1)
    assert found == [{0: (0, 0)}, {1: (0, 0)}]


@given(st.integers(0, 10**6), st.integers(2, 14))
def test_no_two_vehicles_meet_from_any_positions(seed, n):
    draw = np.random.default_rng(seed)
    places = np.empty((0, 3))
    while len(places) < n:
        place = draw.uniform((-1.0, -1.0, 0.2), (1.0, 1.0, 4.0))
        # Some are on the ground, and some right above others.
        if draw.random() < 0.2:
            place[2] = 0.0
        elif len(places) and draw.random() < 0.4:
            place[:2] = places[draw.integers(len(places)), :2]
        if distance(np.vstack([places, place])) >= 0.3:
            places = np.vstack([places, place])
    flying = int((places[:, 2] > 0.0).sum())
    found, least = rounds(places)
    assert sum(map(len, found)) == flying
    assert least >= 0.3 - 1e-5


def test_buffers_may_differ():
    limits = squareform([0.3, 0.9, 0.9])
    places = np.array([(0.0, 0.0, 1.0), (0.5, 0.0, 1.0), (0.0, 0.8, 2.0)])
    all_land, box = np.ones(3, dtype=bool), np.full((3, 2), np.inf)
    found = Scene(places, all_land, ~all_land, limits, -box, box).next_round()
    assert found == {0: pytest.approx((0.0, 0.0)), 1: pytest.approx((0.5, 0.0))}


@given(st.integers(0, 10**6))
def test_moves_are_reachable_if_no_vehicle_comes_near(seed):
    draw = np.random.default_rng(seed)
    n, limit = 6, 0.3
    places = draw.uniform((-0.6, -0.6, 0.8), (0.6, 0.6, 1.2), (n, 3))
    flags, box = np.zeros(n, dtype=bool), np.full((n, 2), np.inf)
    scene = Scene(places, ~flags, flags, np.full((n, n), limit), -box, box)
    goals = draw.uniform(-1.0, 1.0, (20, 2))
    chosen = {1: (0.5, 0.0), 4: (-0.5, 0.2)}
    for goal, is_clear in zip(goals, scene.are_reachable(0, goals, chosen), strict=True):
        ends = places.copy()
        ends[0, :2] = goal
        for j, place in chosen.items():
            ends[j, :2] = place
        tracks = places + np.linspace(0.0, 1.0, 500)[:, None, None] * (ends - places)
        apart = np.linalg.norm((tracks[:, 1:] - tracks[:, :1]) * SCALE, axis=2)
        # Who is too near already must not come nearer.
        excess = (apart - np.minimum(limit, apart[0])).min()
        if abs(excess) > 2e-3:
            assert is_clear == (excess > 0.0)
        elif excess < -1e-5:
            assert not is_clear


def test_a_place_behind_another_vehicle_is_the_last_resort():
    # In a corridor along x: a vehicle above one on the ground, and one that hovers next to it.
    places = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.33, 0.0, 1.0)])
    flags = np.array([True, False, False])
    box = np.array([[-2.0, -0.02]] * 3), np.array([[2.0, 0.02]] * 3)
    stands, limits = np.array([False, True, False]), np.full((3, 3), 0.3)
    found = Scene(places, flags, stands, limits, *box).next_round()
    assert found == {0: pytest.approx((-0.45, 0.0))}
    box = np.array([[-0.4, -0.02]] * 3), np.array([[2.0, 0.02]] * 3)
    # Only behind the other one there is room: it is the place, though the way is not clear.
    found = Scene(places, flags, stands, limits, *box).next_round()
    assert found == {0: pytest.approx((0.75, 0.0))}


def test_who_descends_already_lands_where_it_is_or_beside_what_is_beneath():
    places = np.array([(0.0, 0.0, 2.0), (0.1, 0.0, 1.0), (2.0, 0.0, 0.0)])
    stands, limits = np.array([False, False, True]), np.full((3, 3), 0.3)
    assert landing_place(1, places, stands, limits) == (0.1, 0.0)
    x, y = landing_place(0, places, stands, limits)
    assert 0.3 < np.hypot(x - 0.1, y) < 0.5
    # Between others on all sides it cannot leave.
    angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = np.stack([0.35 * np.cos(angles), 0.35 * np.sin(angles), np.full(12, 2.0)], axis=-1)
    places = np.vstack([places[:2], ring])
    stands, limits = np.zeros(14, dtype=bool), np.full((14, 14), 0.3)
    assert landing_place(0, places, stands, limits) == (0.0, 0.0)


@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0, -1)])
@pytest.mark.parametrize(("spacing", "steps"), [(0.375, 8), (0.35, 9)])
def test_a_descent_at_once_goes_only_so_far_aside(direction, spacing, steps):
    # On a floor full of vehicles one place is free, 3.0 or 3.15 m aside.
    axis = spacing * np.arange(-11, 12)
    floor = np.stack(np.meshgrid(axis, axis, [0.0]), axis=-1).reshape(-1, 3)
    hole = spacing * steps * np.array(direction)
    floor = floor[np.hypot(*(floor[:, :2] - hole).T) > 0.1]
    places = np.vstack([[(0.0, 0.0, 2.0)], floor])
    stands, limits = np.arange(len(places)) > 0, np.full((len(places),) * 2, 0.3)
    expected = hole if spacing * steps <= MAX_DETOUR else np.zeros(2)
    assert landing_place(0, places, stands, limits) == pytest.approx(tuple(expected))


def test_a_descent_at_once_goes_straight_down_beside_a_vehicle():
    places = np.array([(0.0, 0.0, 2.0), (0.305, 0.0, 0.0)])
    assert landing_place(0, places, np.array([False, True]), np.full((2, 2), 0.3)) == (0.0, 0.0)


def test_without_a_vehicle_to_land_none_lands():
    none, box = np.zeros(2, dtype=bool), np.full((2, 2), np.inf)
    places = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, 2.0)])
    assert Scene(places, none, none, np.full((2, 2), 0.3), -box, box).next_round() == {}


def test_a_small_vehicle_above_many_large_ones_finds_a_place_beside_them():
    axis = 1.55 * np.arange(-2, 3)
    floor = np.stack(np.meshgrid(axis, axis, [0.0]), axis=-1).reshape(-1, 3)
    places = np.vstack([[(0.0, 0.0, 2.0)], floor])
    radii = np.array([0.15, *[0.9] * 25])
    is_down, box = np.arange(26) > 0, np.full((26, 2), np.inf)
    found = Scene(places, ~is_down, is_down, radii[:, None] + radii, -box, box).next_round()
    assert np.hypot(*(floor[:, :2] - found[0]).T).min() >= 1.05


@pytest.mark.parametrize(("x", "is_free"), [(0.65, False), (0.66, True)])
def test_a_place_below_a_vehicle_that_hovers_above_may_be_nearer(x, is_free):
    # 0.48 m above, which is as 0.24 m aside: sqrt(0.315^2 - 0.24^2) = 0.204 m are enough.
    places = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (x, 0.0, 1.48)])
    lands, is_down = np.array([True, False, False]), np.array([False, True, False])
    box = np.array([[-0.4, -0.02]] * 3), np.array([[2.0, 0.02]] * 3)
    found = Scene(places, lands, is_down, np.full((3, 3), 0.3), *box).next_round()
    assert (found[0] == pytest.approx((0.45, 0.0))) == is_free


@pytest.mark.parametrize(
    ("other", "goal", "is_reachable"),
    [
        # It stays in front of the goal, or the way ends too near to it.
        ((0.81, 0.0), (0.5, 0.0), True),
        ((0.79, 0.0), (0.5, 0.0), False),
        # It is too near already: the vehicle may leave.
        ((0.2, 0.0), (-1.0, 0.0), True),
        ((0.2, 0.0), (1.0, 0.0), False),
    ],
)
def test_a_goal_is_reachable_if_the_way_to_it_is(other, goal, is_reachable):
    places = np.array([(0.0, 0.0, 1.0), (*other, 1.0)])
    flags, box = np.zeros(2, dtype=bool), np.full((2, 2), np.inf)
    scene = Scene(places, ~flags, flags, np.full((2, 2), 0.3), -box, box)
    assert scene.are_reachable(0, np.array([goal]), {}).tolist() == [is_reachable]
