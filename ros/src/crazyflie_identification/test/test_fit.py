"""The fit of a model, against vehicles that are known."""

import dataclasses
import math

import numpy as np
import pytest
from excited_flights import KIND, PERIOD, Simulated, Virtual, drawn, fly

from crazyflie_identification.fit import (
    NAMES,
    IdentificationError,
    Recording,
    identify,
    residuals,
)
from crazyflie_lqr.vehicle_gains import gains

#: The gains with which a vehicle is flown whose model is not known: K_manual.txt.
DEFAULT = np.zeros((4, 7))
DEFAULT[[0, 0, 1, 1, 2, 3, 3], [1, 4, 0, 3, 6, 2, 5]] = (0.25, 1.0, -0.25, -1.0, -3.5, -1.5, -1.0)

LEVEL = 1.96  #: Standard errors on each side of an interval of 95 %.


def truth(vehicle):
    return np.array(
        [
            vehicle.mass,
            0.0,
            vehicle.delay,
            vehicle.roll_lag,
            vehicle.pitch_lag,
            vehicle.yaw_lag,
            vehicle.motor_time_constant,
            vehicle.drag_rates[0],
            vehicle.roll_trim,
            vehicle.pitch_trim,
            0.0,
            0.0,
        ]
    )


def identified(seed, duration, kind):
    vehicle = drawn(seed)
    recording, _ = fly(vehicle, DEFAULT, duration=duration, seed=seed, kind=kind)
    return vehicle, identify(recording, KIND)


@pytest.mark.parametrize("kind", [Simulated, Virtual])
@pytest.mark.parametrize("seed", [1001, 1002])
def test_a_vehicle_is_found(seed, kind):
    vehicle, found = identified(seed, 20.0, kind)
    errors = found.values - truth(vehicle)
    assert (np.abs(errors) < 4.0 * found.errors).all()
    assert abs(errors[0]) < 0.02 * vehicle.mass
    assert abs(errors[NAMES.index("delay")]) < 0.005
    assert found.model.pwm(9.81) == pytest.approx(vehicle.pwm(9.81), rel=1e-3)
    # The part that was not used is predicted as well as motion capture measures it.
    rest = residuals(found.values, KIND, found.thrust, found.unused).std(axis=0)
    assert (rest < [0.0003] * 3 + [0.0015] * 3).all()


# The quick one is test_a_vehicle_is_found.
@pytest.mark.long
def test_of_fifty_virtual_vehicles_95_percent_of_the_figures_are_in_their_intervals():
    inside, count = 0, 0
    for seed in range(50):
        vehicle, found = identified(seed, 40.0, Virtual)
        errors = np.abs(found.values - truth(vehicle))
        inside += int((errors < LEVEL * found.errors).sum())
        count += len(NAMES)
        assert errors[0] < 0.02 * vehicle.mass
        assert errors[NAMES.index("delay")] < 0.005
    # Within the counting error of so many draws, three standard deviations.
    counting = 3.0 * math.sqrt(0.95 * 0.05 / count)
    assert inside / count == pytest.approx(0.95, abs=counting)


def figure_eight(t):
    """Return displacement (m) and velocity (m/s) of a figure eight of 6.3 s, 1 m wide."""
    w = 1.0
    a, b = 0.5, 0.25
    return (
        (a * math.sin(w * t), b * math.sin(2.0 * w * t), 0.0),
        (a * w * math.cos(w * t), 2.0 * b * w * math.cos(2.0 * w * t), 0.0),
    )


def test_gains_for_the_model_halve_the_error_of_a_heavy_late_vehicle():
    vehicle = dataclasses.replace(
        KIND, mass=0.045, delay=0.06, roll_lag=0.1, pitch_lag=0.1, yaw_lag=0.1
    )
    recording, _ = fly(vehicle, DEFAULT, duration=20.0)
    model = identify(recording, KIND).model
    # The integrator has 8 s to find the weight of the vehicle that is taken for 33 g.
    _, before = fly(vehicle, DEFAULT, KIND, 13.0, figure_eight)
    _, after = fly(vehicle, gains(model), model, 13.0, figure_eight)
    rms = [float(np.sqrt(np.mean(errors**2))) for errors in (before, after)]
    assert rms[1] < 0.5 * rms[0]


def still(duration):
    """Return a flight at one place."""
    times = np.arange(0.0, duration, PERIOD)
    noise = np.random.default_rng(0).normal(0.0, [2e-4] * 3 + [1e-3] * 3, (len(times), 6))
    commands = np.tile([0.0, 0.0, 0.0, KIND.pwm(9.81)], (len(times), 1))
    return Recording(times, commands, times, noise + [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def test_a_flight_without_motion_tells_no_drag_and_no_lag():
    with pytest.raises(IdentificationError) as error:
        identify(still(17.0), KIND)
    text = str(error.value)
    assert "this bag does not determine drag; fly to and fro at 0.4 m/s" in text
    assert "this bag does not determine roll lag; move left and right" in text
    assert "excite:=true" in text


@pytest.mark.parametrize(
    ("thrust", "expected"),
    [(0.0, "have no thrust"), (100.0, "does not determine mass"), (2000.0, "determine mass")],
)
def test_commands_that_carry_no_vehicle_are_refused(thrust, expected):
    flight = still(17.0)
    flight.commands[:, 3] = thrust
    with pytest.raises(IdentificationError, match=expected):
        identify(flight, KIND)


def test_a_flight_that_is_too_short_is_refused_with_its_length():
    with pytest.raises(IdentificationError, match=r"has 4.0 s of .*; expected at least 15 s"):
        identify(still(4.0), KIND)
