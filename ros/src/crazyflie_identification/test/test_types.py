"""The bounds of the types, on which the fence rests, against flights of simulated vehicles.

They stand in docs/geofence_proof.md, measured with more flights.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from excited_flights import Virtual
from fenced_flights import Rigid, fly

from crazyflie_geofence import bounds


def axes_of(name):
    return bounds.axes(bounds.load(name), 1.4, 2.0)


def charged(name):
    """Return a virtual vehicle of a type, with a full battery."""
    return partial(Virtual.of_type, name)


@pytest.mark.parametrize(
    ("kind", "name", "seed"),
    [
        (Rigid, "cf21", 100),
        # The tilt is reversed at 4 m/s^2 of thrust, which jumps to its most.
        (charged("cf21"), "cf21", 3013),
        pytest.param(Rigid, "cf21_markers", 103, marks=pytest.mark.long),
        pytest.param(Rigid, "cf21plus", 104, marks=pytest.mark.long),
        # Full tilt, and all of the thrust that the battery leaves.
        pytest.param(charged("cf21plus"), "cf21plus", 5000, marks=pytest.mark.long),
        pytest.param(Rigid, "brushless", 105, marks=pytest.mark.long),
    ],
)
def test_a_simulated_vehicle_moves_within_the_bounds_of_its_type(kind, name, seed):
    axes = axes_of(name)
    flight = fly(kind, name, seed, 12.0, axes)
    assert flight.outside < 0.0
    # It presses against the walls for most of the time.
    assert flight.changed.mean() > 0.5
    assert flight.position_error() <= axes[0].position_error
    for k, axis in enumerate(axes):
        assert flight.velocity_error(k, axis) <= axis.velocity_error


def figure_eight(t):
    """Return position and velocity 10 cm from walls at 2 m, at up to 1 m/s."""
    w = 1.0 / (1.9 * math.sqrt(2.0))
    offset = 1.9 * math.sin(w * t), 0.95 * math.sin(2.0 * w * t), 0.0
    return offset, (1.9 * w * math.cos(w * t), 1.9 * w * math.cos(2.0 * w * t), 0.0)


def test_a_figure_eight_10_cm_from_the_walls_is_flown_as_without_a_fence():
    flights = [
        fly(Rigid, "cf21", 1, 34.0, axes_of("cf21"), late=False, half=half, path=figure_eight)
        for half in (2.0, 20.0)
    ]
    assert not np.any(flights[0].changed)
    np.testing.assert_array_equal(flights[0].positions, flights[1].positions)
    assert -0.1 < flights[0].outside < -0.03


class InWind:
    """The body of a virtual vehicle in a steady wind, m/s."""

    def __init__(self, body, wind):
        self._body, self._wind = body, wind

    def __getattr__(self, name):
        return getattr(self._body, name)

    def step(self, t, x, speeds, _, dt):
        return self._body.step(t, x, speeds, self._wind, dt)


def in_wind(direction, model, *errors):
    """Return a virtual cf21 in a wind that pushes it with 0.4 m/s^2."""
    vehicle = Virtual.of_type("cf21", model, *errors)
    physics = vehicle._vehicle.physics
    wind = 1.9 * math.cos(direction), 1.9 * math.sin(direction), 0.0
    physics._airframe = InWind(physics._airframe, wind)
    return vehicle


@pytest.mark.parametrize("flights", [2, pytest.param(100, marks=pytest.mark.long)])
def test_packets_that_are_late_and_a_wind_lead_no_virtual_vehicle_out(flights, capsys):
    """Of the controls, hardly any is changed that need not be."""
    limits = replace(
        bounds.load("cf21"),
        delay=0.05,
        horizontal_disturbance=0.8,
        vertical_disturbance=1.2,
        velocity_error=0.1,
    )
    axes = bounds.axes(limits, 1.4, 2.0)
    found = []
    for seed in range(flights):
        kind = partial(in_wind, 2.4 * seed)
        flight = fly(kind, "cf21", seed, 6.0, axes, delay=0.03, half=1.25)
        for k, axis in enumerate(axes):
            assert flight.velocity_error(k, axis) <= axis.velocity_error
        spared = flight.changed & ~flight.needed
        found.append((flight.outside, flight.changed.mean(), spared.mean()))
    outside, changed, spared = np.array(found).T
    with capsys.disabled():
        print(
            f"\n{flights} flights, nearest to a wall {-1e3 * outside.max():.1f} mm; changed "
            f"{changed.mean():.1%} of the controls, without need {spared.mean():.1%}"
        )
    assert np.all(outside < 0.0)
    assert changed.mean() > 0.5
    assert spared.mean() < 0.05


@pytest.mark.parametrize("seed", [1003, 1004])
def test_the_kalman_filter_needs_a_larger_bound_of_velocities(seed):
    """With noise of 0.2 mm and the control, whose lag of 0.1 s is not the vehicle's: 8 cm/s."""
    axes = axes_of("cf21")
    flight = fly(Rigid, "cf21", seed, 12.0, axes, noise=2e-4, kalman=True)
    errors = [flight.velocity_error(k, axis) for k, axis in enumerate(axes)]
    assert 0.04 < max(errors) < 0.08
    assert flight.position_error() <= axes[0].position_error
