"""Distances of a mission's positions, by figures that are calculated by hand."""

import numpy as np
import pytest

from crazyflie_mission_api import MissionError
from crazyflie_mission_api.limits import Clearance

TIMES = np.array([0.0, 0.5, 1.0])
BUFFERS = {"a": 0.15, "b": 0.15}


def standing(*places):
    """Return places (n, m, 3) of vehicles that stay where they are, but for the last moment."""
    apart = [[5.0 * k, -3.0, 1.0] for k in range(len(places))]
    return np.array([[here, here, place] for here, place in zip(apart, places, strict=True)])


@pytest.mark.parametrize(
    ("offset", "is_refused"),
    [
        ([0.3, 0.0, 0.0], False),
        ([0.299, 0.0, 0.0], True),
        ([0.0, -0.299, 0.0], True),
        # sqrt(0.18^2 + 0.24^2) = 0.3.
        ([0.18, 0.24, 0.0], False),
        # Heights count half.
        ([0.0, 0.0, 0.6], False),
        ([0.0, 0.0, -0.598], True),
        ([0.18, 0.0, 0.48], False),
        ([0.18, 0.0, 0.47], True),
    ],
)
def test_the_least_distance_at_the_last_moment(offset, is_refused):
    there = np.array([2.0, -7.0, 3.0])
    places = standing([9.0, 9.0, 9.0], there, there + offset)
    check = Clearance(0.3).check
    if not is_refused:
        check(["a", "b", "c"], TIMES, places)
        return
    text = r"^b and c would be 0.29\d+ m apart, 1.0 s from now; expected at least 0.3 m$"
    with pytest.raises(MissionError, match=text):
        check(["a", "b", "c"], TIMES, places)


def test_the_pair_that_is_nearest_for_its_limit_is_refused():
    # a and b have 0.4 m and need 0.3 m; b and c have 0.6 m and need 1.1 times 0.6 m.
    places = standing([0.0, 0.0, 1.0], [0.4, 0.0, 1.0], [1.0, 0.0, 1.0])
    clearance = Clearance(0.3, {"b": 0.3, "c": 0.3})
    with pytest.raises(MissionError, match=r"^b and c would be 0.6 m apart, .* at least 0.66 m"):
        clearance.check(["a", "b", "c"], TIMES, places)


def head_on(speed, least):
    """Return times and places of two vehicles that approach each other until so near (m, m/s)."""
    times = np.arange(0.0, (2.0 - least) / (2.0 * speed) + 1e-9, 0.1)
    zero = np.zeros_like(times)
    first = np.stack([speed * times, zero, zero + 1.0], axis=1)
    second = np.stack([2.0 - speed * times, zero, zero + 1.0], axis=1)
    return times, np.array([first, second])


def test_an_approach_that_the_fleet_would_hold_is_refused():
    # At 1 m/s they are 0.5 m nearer in 0.5 s: less than 1.1 * 0.3 m from 0.83 m on, which is after
    # 1.17 s; the next moment is 1.2 s, at 0.8 m.
    text = (
        r"^a and b would come near each other too fast, 1.2 s from now: at 0.8 m, and in 0.5 s at "
        r"their speeds less than 0.33 m; expected slower"
    )
    with pytest.raises(MissionError, match=text):
        Clearance(0.3, BUFFERS).check(["a", "b"], *head_on(0.5, 0.4))


@pytest.mark.parametrize(
    ("speed", "least", "buffers"),
    [
        # Before 0.83 m; so slowly that 0.4 - 0.04 m are enough; or not watched by a fleet.
        (0.5, 0.9, BUFFERS),
        (0.04, 0.4, BUFFERS),
        (0.5, 0.4, {}),
        (0.5, 0.4, {"a": 0.15}),
        (0.5, 0.4, {"other": 0.15, "a": 0.15}),
    ],
)
def test_other_approaches_are_flown(speed, least, buffers):
    Clearance(0.3, buffers).check(["a", "b"], *head_on(speed, least))


def test_one_that_flies_towards_one_that_stays_is_refused():
    times = np.arange(0.0, 1.4, 0.1)
    zero = np.zeros_like(times)
    flying = np.stack([times, zero, zero + 1.0], axis=1)
    staying = np.stack([zero + 2.0, zero, zero + 1.0], axis=1)
    for vehicles in ([flying, staying], [staying, flying]):
        # 0.83 m is reached after 1.17 s.
        with pytest.raises(MissionError, match=r"too fast, 1.2 s from now: at 0.8 m"):
            Clearance(0.3, BUFFERS).check(["a", "b"], times, np.array(vehicles))


def test_three_moments_are_enough_to_see_an_approach():
    places = np.array([[[x, 0.0, 1.0], [x + 0.2, 0.0, 1.0], [x + 0.4, 0.0, 1.0]] for x in (0, 1)])
    places[1, :, 0] = 0.9
    with pytest.raises(MissionError, match="too fast, 0.0 s from now"):
        Clearance(0.3, BUFFERS).check(["a", "b"], np.array([0.0, 0.1, 0.2]), places)
    # Two references do not yet give a speed.
    Clearance(0.3, BUFFERS).check(["a", "b"], np.array([0.0, 0.1]), places[:, :2])


@pytest.mark.parametrize(("buffers", "names"), [({}, False), ({"a": 0.1}, False), (BUFFERS, True)])
def test_buffers_are_named_where_both_vehicles_have_one(buffers, names):
    places = standing([0.0, 0.0, 1.0], [0.2, 0.0, 1.0])
    with pytest.raises(MissionError) as caught:
        Clearance(0.3, buffers).check(["a", "b"], TIMES, places)
    assert ("are 0.15 and 0.15 m" in str(caught.value)) == names
