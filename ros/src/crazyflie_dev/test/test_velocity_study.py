"""What the Kalman filter promises over the finite difference, measured."""

import math
from dataclasses import replace

import numpy as np
import pytest

from crazyflie_dev import velocity_study
from crazyflie_dev.velocity_study import (
    FILTERS,
    IDEAL,
    PERIOD,
    REAL,
    SampledFlight,
    estimate,
    fly,
    lag,
    rms_error,
)
from crazyflie_model.units import GRAVITY

MAX_ADDED_LAG = 0.020
LEVEL = np.array([0.0, 0.0, 0.0, GRAVITY])


@pytest.fixture(scope="module", params=[IDEAL, REAL], ids=["ideal vehicle", "real vehicle"])
def flight(request):
    return fly(request.param, 40.0, seed=1)


@pytest.fixture(scope="module")
def finite_difference(flight):
    return estimate(flight, *FILTERS["finite difference"])


def test_the_flight_is_one_with_manoeuvres(flight):
    speed = np.linalg.norm(flight.velocity, axis=1)
    acceleration = np.linalg.norm(np.diff(flight.velocity, axis=0) / PERIOD, axis=1)
    assert speed.max() > 1.0
    assert acceleration.max() > 2.0
    assert np.ptp(flight.yaw) > math.pi
    assert np.std(flight.measured - flight.position) == pytest.approx(0.001, rel=0.05)


def test_finite_differences_are_as_bad_as_they_must_be(flight, finite_difference):
    assert rms_error(flight, finite_difference) == pytest.approx(
        math.sqrt(2.0) * 0.001 / PERIOD, rel=0.05
    )
    assert lag(flight, finite_difference) == pytest.approx(PERIOD / 2.0, abs=0.003)


@pytest.mark.parametrize(("name", "factor"), [("Kalman", 3.0), ("Kalman with control", 5.0)])
def test_kalman_is_so_many_times_better(flight, finite_difference, name, factor):
    velocity = estimate(flight, *FILTERS[name])
    assert rms_error(flight, velocity) * factor < rms_error(flight, finite_difference)
    assert lag(flight, velocity) - lag(flight, finite_difference) < MAX_ADDED_LAG


def moving_in_z(position, velocity, thrust, measured=None):
    """Return a flight straight up and down; all arguments of shape (n,)."""
    zeros = np.zeros_like(position)

    def upwards(values):
        return np.stack([zeros, zeros, values], axis=1)

    control = np.stack([zeros, zeros, zeros, thrust], axis=1)
    measured = position if measured is None else measured
    return SampledFlight(upwards(position), upwards(velocity), zeros, control, upwards(measured))


@pytest.mark.parametrize("frequency", [0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("name", ["Kalman", "Kalman with control"])
def test_lag_and_gain_on_a_sine(name, frequency):
    omega = 2.0 * math.pi * frequency
    time = PERIOD * np.arange(round(10.0 / PERIOD))
    amplitude = 4.0 / omega**2
    # Held from one sample to the next, the control is that of the middle.
    flight = moving_in_z(
        amplitude * np.sin(omega * time),
        amplitude * omega * np.cos(omega * time),
        GRAVITY - amplitude * omega**2 * np.sin(omega * (time + PERIOD / 2.0)),
    )
    velocity = estimate(flight, *FILTERS[name])
    finite_difference = estimate(flight, *FILTERS["finite difference"])
    assert lag(flight, velocity) - lag(flight, finite_difference) < MAX_ADDED_LAG
    settled = slice(round(5.0 / PERIOD), None)
    assert np.abs(velocity[settled, 2]).max() == pytest.approx(amplitude * omega, rel=0.3)


def test_takeoff_and_landing_do_not_mislead_the_filter_that_is_told_the_control():
    """On the ground a vehicle does not do what its thrust would have it do in the air."""
    time = PERIOD * np.arange(round(9.0 / PERIOD))
    takeoff, touchdown = 2.0, 6.0
    flying = (time >= takeoff) & (time < touchdown)
    acceleration = np.select([flying & (time < 3.0), flying & (time >= 5.0)], [0.2, -0.5])
    velocity = PERIOD * np.concatenate([[0.0], np.cumsum(acceleration[:-1])])
    velocity[time >= touchdown] = 0.0
    # Zero thrust before takeoff; after touchdown it ramps down from g, then is zero.
    ramp = np.where(time < touchdown + 1.0, GRAVITY - 5.0 * (time - touchdown), 0.0)
    thrust = np.select([time < takeoff, flying], [0.0, GRAVITY + acceleration], ramp)
    flight = moving_in_z(np.cumsum(PERIOD * velocity), velocity, thrust)
    error = np.abs(estimate(flight, *FILTERS["Kalman with control"]) - flight.velocity)[:, 2]
    assert velocity[flying][-1] == pytest.approx(-0.3, abs=0.01)
    assert error[time < touchdown].max() < 0.02
    assert error[time > touchdown + 0.5].max() < 0.03
    assert error[time > touchdown + 1.5].max() < 0.01


def test_wrong_signs_of_the_control_would_be_noticed(flight):
    opposite = replace(flight, control=flight.control * [-1.0, -1.0, 1.0, 1.0])
    told_wrongly = estimate(opposite, *FILTERS["Kalman with control"])
    told = estimate(flight, *FILTERS["Kalman with control"])
    assert rms_error(flight, told_wrongly) > 1.5 * rms_error(flight, told)


def test_draws_its_figure(tmp_path, monkeypatch, capsys):
    path = tmp_path / "velocity_filter.png"
    monkeypatch.setattr("sys.argv", ["velocity_study", str(path)])
    velocity_study.main()
    assert path.read_bytes().startswith(b"\x89PNG")
    table = capsys.readouterr().out
    assert all(name in table for name in FILTERS)
