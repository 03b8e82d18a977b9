"""Demands of trajectories on a vehicle, against numbers that were calculated by hand."""

import math

import pytest

from crazyflie_mission_api import Bounds, Limits, MissionError
from crazyflie_mission_api.trajectories import (
    check,
    check_numbers,
    demands,
    duration,
    excess,
    sampled,
    within_limits,
)
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_model.trajectory import stretched

NOWHERE = (0.0,) * 8


def quadratic(a):
    """Return the coefficients of a t^2 / 2: a speed that grows by a every second."""
    return (0.0, 0.0, a / 2.0, *NOWHERE[3:])


#: Accelerates by (1, 2, 2) m/s^2 and 0.5 rad/s^2 for 2 s.
ALL_AXES = [PolynomialPiece(2.0, quadratic(1.0), quadratic(2.0), quadratic(2.0), quadratic(0.5))]

# At its end the velocity is (2, 4, 4), the thrust points along (1, 2, 2 + 9.81).
BY_HAND = {
    "speed": 6.0,
    "acceleration": 3.0,
    "yaw_rate": 1.0,
    "tilt": 0.187122,  # atan(sqrt(5) / 11.81)
    "max_thrust": 12.019821,  # sqrt(5 + 11.81^2)
    "min_thrust": -12.019821,
}


def test_the_demands_of_a_trajectory_on_all_axes():
    found = demands(sampled(ALL_AXES)[1])
    assert found.keys() == BY_HAND.keys()
    for name, value in BY_HAND.items():
        assert found[name][-1] == pytest.approx(value, abs=2e-6), name
    # Half-way, after 15/29 of 30 samples; only speed and yaw rate grow.
    assert found["speed"][15] == pytest.approx(6.0 * 15 / 29)
    assert found["yaw_rate"][15] == pytest.approx(15 / 29)
    assert found["acceleration"][0] == pytest.approx(3.0)


# Acceleration by axis, m/s^2 (yaw: rad/s^2); then after 2 s speed, acceleration, yaw rate,
# tilt and thrust.
ALONE = [
    ((3.0, 0.0, 0.0, 0.0), (6.0, 3.0, 0.0, 0.296779, 10.258465)),  # atan(3/9.81), sqrt(9+9.81^2)
    ((-3.0, 0.0, 0.0, 0.0), (6.0, 3.0, 0.0, 0.296779, 10.258465)),
    ((0.0, 3.0, 0.0, 0.0), (6.0, 3.0, 0.0, 0.296779, 10.258465)),
    ((0.0, -3.0, 0.0, 0.0), (6.0, 3.0, 0.0, 0.296779, 10.258465)),
    ((0.0, 0.0, 4.0, 0.0), (8.0, 4.0, 0.0, 0.0, 13.81)),
    ((0.0, 0.0, -4.0, 0.0), (8.0, 4.0, 0.0, 0.0, 5.81)),
    ((0.0, 0.0, 0.0, 0.7), (0.0, 0.0, 1.4, 0.0, 9.81)),
    ((0.0, 0.0, 0.0, -0.7), (0.0, 0.0, 1.4, 0.0, 9.81)),
    # Upside down: thrust along (0, 0, -2.19), the opposite of up.
    ((0.0, 0.0, -12.0, 0.0), (24.0, 12.0, 0.0, math.pi, 2.19)),
]


@pytest.mark.parametrize(("rates", "expected"), ALONE)
def test_the_demands_of_one_axis(rates, expected):
    found = demands(sampled([PolynomialPiece(2.0, *map(quadratic, rates))])[1])
    names = ("speed", "acceleration", "yaw_rate", "tilt", "max_thrust")
    for name, value in zip(names, expected, strict=True):
        assert found[name][-1] == pytest.approx(value, abs=2e-6), name
    assert found["min_thrust"][-1] == pytest.approx(-expected[-1], abs=2e-6)


GENEROUS = {
    "speed": 6.1,
    "acceleration": 3.1,
    "yaw_rate": 1.1,
    "tilt": 0.188,
    "max_thrust": 12.1,
    "min_thrust": 9.0,
}
MEAN = {
    "speed": 5.9,
    "acceleration": 2.9,
    "yaw_rate": 0.9,
    "tilt": 0.187,
    "max_thrust": 12.0,
}


@pytest.mark.parametrize("name", MEAN)
def test_each_limit_is_kept_by_itself(name):
    assert excess(ALL_AXES, Limits(**GENEROUS)) == {}
    found = excess(ALL_AXES, Limits(**{**GENEROUS, name: MEAN[name]}))
    assert found.keys() == {name}
    assert found[name][0] == pytest.approx(BY_HAND[name], abs=2e-6)


def test_thrust_has_a_lower_limit_too():
    sinking = [PolynomialPiece(1.0, NOWHERE, NOWHERE, quadratic(-4.0), NOWHERE)]
    wide = {"speed": 10.0, "acceleration": 10.0}
    assert excess(sinking, Limits(**wide, min_thrust=5.8)) == {}
    assert excess(sinking, Limits(**wide, min_thrust=5.9)) == {
        "min_thrust": (pytest.approx(5.81), 0.0)
    }
    everywhere = Bounds((-math.inf,) * 3, (math.inf,) * 3)
    with pytest.raises(MissionError, match=r"thrust is 5.81 m/s\^2 at 0.00 s; expected at least 5"):
        check(sinking, Limits(**wide, min_thrust=5.9), everywhere, "it", "more time")


def test_what_a_longer_duration_does():
    # In twice the time speeds are 1/2, accelerations 1/4 as large.
    found = demands(sampled(stretched(ALL_AXES, 2.0))[1])
    assert found["speed"][-1] == pytest.approx(3.0)
    assert found["acceleration"][-1] == pytest.approx(0.75)
    assert found["yaw_rate"][-1] == pytest.approx(0.5)
    # sqrt(0.25^2 + 0.5^2) against 0.5 + 9.81.
    assert found["tilt"][-1] == pytest.approx(math.atan2(0.559017, 10.31), abs=2e-6)


@pytest.mark.parametrize(
    ("limits", "seconds"),
    [
        ({"speed": 3.0}, 4.0),
        ({"yaw_rate": 0.25}, 8.0),
        ({"acceleration": 0.75}, 4.0),
    ],
)
def test_a_trajectory_is_as_slow_as_a_limit_demands(limits, seconds):
    wide = {"speed": 100.0, "acceleration": 100.0, "yaw_rate": 100.0, "tilt": 1.5}
    slow = within_limits(ALL_AXES, Limits(**{**wide, "max_thrust": 100.0, **limits}))
    assert duration(slow) == pytest.approx(seconds)


def test_samples_are_of_all_pieces_one_after_the_other():
    pieces = [PolynomialPiece(t, (x, 1.0), (), (2.0,), (3.0,)) for t, x in ((2.0, 0.0), (0.5, 2.0))]
    times, values = sampled(pieces)
    assert times[[0, 29, 30, 59]] == pytest.approx([0.0, 2.0, 2.0, 2.5])
    assert values.shape == (3, 4, 60)
    assert values[0, 0] == pytest.approx(times)
    assert values[:, 2, 0].tolist() == [2.0, 0.0, 0.0]
    assert values[0, 3, -1] == 3.0


def test_the_moment_of_the_worst_demand_is_told():
    slow = PolynomialPiece(1.0, (0.0, 0.1), NOWHERE, NOWHERE, NOWHERE)
    (found,) = excess([slow, *ALL_AXES], Limits(**{**GENEROUS, "speed": 5.9})).values()
    assert found == (pytest.approx(6.0), pytest.approx(3.0))


@pytest.mark.parametrize("name", MEAN)
def test_what_is_exactly_at_a_limit_is_flown(name):
    at_limit = float(demands(sampled(ALL_AXES)[1])[name].max())
    assert excess(ALL_AXES, Limits(**{**GENEROUS, name: at_limit})) == {}


@pytest.mark.parametrize(
    "piece",
    [
        PolynomialPiece(0.0, NOWHERE, NOWHERE, NOWHERE, NOWHERE),
        PolynomialPiece(-1.0, NOWHERE, NOWHERE, NOWHERE, NOWHERE),
        PolynomialPiece(math.inf, NOWHERE, NOWHERE, NOWHERE, NOWHERE),
        PolynomialPiece(1.0, NOWHERE, NOWHERE, NOWHERE, (*NOWHERE[:7], math.nan)),
    ],
)
def test_numbers_that_mean_nothing_are_refused(piece):
    check_numbers(ALL_AXES, "it")
    with pytest.raises(MissionError, match="it: piece 2 has numbers that are not finite"):
        check_numbers([*ALL_AXES, piece], "it")


def test_tilt_and_thrust_are_kept_by_more_time_and_hardly_more_than_needed():
    wide = {"speed": 100.0, "acceleration": 100.0, "yaw_rate": 100.0}
    limits = Limits(**wide, tilt=0.1, max_thrust=100.0, min_thrust=0.1)
    slow = within_limits(ALL_AXES, limits)
    assert 0.09 < demands(sampled(slow)[1])["tilt"].max() <= 0.1 + 1e-6


def test_what_does_not_move_takes_a_moment():
    still = [PolynomialPiece(2.0, NOWHERE, NOWHERE, NOWHERE, NOWHERE)]
    assert duration(within_limits(still, Limits())) == pytest.approx(1e-3)
