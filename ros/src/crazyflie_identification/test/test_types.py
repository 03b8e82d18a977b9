"""The bounds of the types, on which the fence rests, against flights of simulated vehicles.

They stand in docs/geofence_proof.md, measured with more flights.
"""

from functools import partial

import pytest
from excited_flights import Virtual
from fenced_flights import Rigid, fly

from crazyflie_geofence import bounds

AXES = bounds.axes(bounds.OF_TYPES, 1.4, 2.0, 0.01, 0.01)


def charged(name):
    """Return a virtual vehicle of a type, with a full battery."""
    return partial(Virtual.of_type, name)


@pytest.mark.parametrize(
    ("kind", "name", "seed"),
    [
        (Rigid, "cf21", 100),
        (charged("cf21"), "cf21", 101),
        pytest.param(Rigid, "cf21_markers", 103, marks=pytest.mark.long),
        pytest.param(Rigid, "cf21plus", 104, marks=pytest.mark.long),
        pytest.param(Rigid, "brushless", 105, marks=pytest.mark.long),
    ],
)
def test_a_simulated_vehicle_moves_within_the_bounds_of_its_type(kind, name, seed):
    flight = fly(kind, name, seed, 12.0, AXES)
    assert flight.outside < 0.0
    # It presses against the walls for most of the time.
    assert flight.changed.mean() > 0.5
    assert flight.position_error() <= bounds.OF_TYPES.position_error
    for k, axis in enumerate(AXES):
        assert flight.velocity_error(k, axis) <= axis.velocity_error


def test_a_velocity_that_lags_is_seen_as_an_error():
    """Of a Kalman filter that takes a control for the acceleration at once, by 0.1 m/s and more."""
    flight = fly(Rigid, "cf21", 100, 12.0, AXES, noise=2e-4, kalman=True)
    errors = [flight.velocity_error(k, axis) for k, axis in enumerate(AXES)]
    assert max(errors) > 1.5 * bounds.OF_TYPES.velocity_error
