"""Arguments, refusals and results of `simulate`, and its README."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from crazyflie_batch import Controller, Kalman, Measurement, Model, near_hover, quadrotor, simulate
from crazyflie_model.dynamics import Coupled7D

README = Path(__file__).parent.parent / "README.md"

K = np.zeros((4, 7))
K[1, [0, 3]] = 0.25, 1.0
K[0, [1, 4]] = -0.25, -1.0
K[3, [2, 5]] = -1.5, -1.0
CONTROLLER = Controller(K)


def test_vehicles_at_rest_at_the_goal_stay_there():
    flights = simulate(near_hover(), CONTROLLER, n=3, duration=1.0)
    assert flights.largest_error.max() < 1e-9
    assert flights.largest_tilt.max() < 1e-6
    assert not flights.has_crashed.any()


def test_outcomes_are_those_of_the_recorded_states():
    start = [(1.0, 0.0, 1.0), (0.0, 2.0, 1.0)]
    flights = simulate(
        near_hover(), CONTROLLER, None, start, 2, duration=4.0, settle_time=2.0, record=True
    )
    assert flights.states.shape == (400, 2, 7)
    assert flights.controls.shape == (400, 2, 4)
    distances = np.linalg.norm(flights.states[..., :3] - (0.0, 0.0, 1.0), axis=-1)
    assert flights.largest_error == pytest.approx(distances[200:].max(axis=0))
    assert flights.rms_error == pytest.approx(np.sqrt((distances[200:] ** 2).mean(axis=0)))
    speeds = np.linalg.norm(flights.states[..., 3:6], axis=-1)
    assert flights.largest_speed == pytest.approx(speeds.max(axis=0))


def test_the_largest_tilt_is_the_one_that_was_commanded():
    start = [(1.0, 0.0, 1.0), (0.3, -0.2, 1.0)]
    flights = simulate(near_hover(), CONTROLLER, None, start, 2, duration=1.0, record=True)
    roll, pitch = flights.controls[..., 0], flights.controls[..., 1]
    tilt = np.arccos(np.cos(roll) * np.cos(pitch)).max(axis=0)
    assert flights.largest_tilt == pytest.approx(tilt, abs=1e-6)
    assert tilt.min() > 0.05


@pytest.mark.parametrize("threads", [1, 3])
def test_a_flight_does_not_depend_on_those_beside_it(threads):
    def fly(n, first):
        numbers = np.arange(first, first + n)
        return simulate(
            quadrotor(mass_error=numbers / 1000.0),
            CONTROLLER,
            Kalman(),
            n=n,
            first=first,
            duration=1.0,
            measurement=Measurement(1e-3, 1e-3, 0.01, 0.2),
            seed=7,
            threads=threads,
        ).x

    together = fly(50, 0)
    assert (fly(20, 30) == together[30:]).all()
    assert len(np.unique(together[:, 0])) == 50


def test_a_state_that_overflows_counts_as_a_crash():
    flights = simulate(near_hover(), Controller(K, u_ref=(0.0, 0.0, 1e308, 9.81)), duration=10.0)
    assert flights.has_crashed.all()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"n": 0}, "n is 0; expected at least one"),
        ({"n": -3}, "n is -3"),
        ({"period": 0.003}, "period is 0.003; expected a whole number of 0.002 s"),
        ({"duration": 0.0}, "duration is 0; expected at least one period, 0.01 s"),
        ({"x0": (0.0, 0.0)}, r"x0 has the shape \(2,\); expected \(3,\) or \(2, 3\)"),
        ({"goal": np.zeros((3, 7))}, r"goal has the shape \(3, 7\)"),
        ({"controller": Controller(np.zeros((4, 6)))}, r"K has the shape \(4, 6\)"),
        ({"model": quadrotor([0.0, 0.1, 0.2])}, "mass_error has the shape"),
        ({"model": quadrotor(np.nan)}, "mass_error is not finite"),
        ({"measurement": Measurement(dropout=[0.1] * 3)}, "dropout has the shape"),
        ({"settle_time": 10.0}, r"settle_time is 10; expected 0 to 9\.99, when the last tick"),
        ({"settle_time": 9.995}, r"settle_time is 9\.995; expected 0 to 9\.99"),
        ({"settle_time": -0.5}, r"settle_time is -0\.5; expected 0 to"),
        ({"settle_time": np.nan}, "settle_time is nan; expected 0 to"),
        ({"settle_time": np.inf}, "settle_time is inf; expected 0 to"),
        ({"duration": np.inf}, "duration is inf; expected"),
        ({"duration": np.nan}, "duration is nan; expected"),
        ({"period": np.inf}, "period is inf; expected a whole number"),
        ({"period": np.nan}, "period is nan; expected a whole number"),
    ],
)
def test_what_is_wrong_is_told(wrong, words):
    arguments = {"model": near_hover(), "controller": CONTROLLER, "n": 2, **wrong}
    with pytest.raises(ValueError, match=words):
        simulate(**arguments)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"position_noise": -1e-3}, r"position_noise is -0\.001; expected at least 0"),
        ({"position_noise": [0.0, -2.0]}, "position_noise is -2; expected at least 0"),
        ({"attitude_noise": -0.1}, r"attitude_noise is -0\.1; expected at least 0"),
        ({"latency": -0.01}, r"latency is -0\.01; expected at least 0"),
        ({"dropout": 1.5}, r"dropout is 1\.5; expected 0 to 1"),
        ({"dropout": [0.5, -0.1]}, r"dropout is -0\.1; expected 0 to 1"),
    ],
)
def test_errors_of_measurement_that_cannot_be_are_refused(wrong, words):
    with pytest.raises(ValueError, match=words):
        simulate(near_hover(), CONTROLLER, n=2, duration=0.1, measurement=Measurement(**wrong))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: quadrotor(mass_error=[0.0, -1.0]), "mass_error is -1; expected more than -1"),
        (lambda: quadrotor(thrust_error=-3.0), "thrust_error is -3; expected more than -1"),
        (lambda: Kalman(noise=0.0), "noise is 0; expected more than 0"),
        (lambda: Kalman(acceleration_walk=[-1.0]), "acceleration_walk is -1; expected more than 0"),
        (
            lambda: Controller(K, integrator_limit=(1.0, -1.0, 1.0)),
            "integrator_limit is -1; expected at least 0",
        ),
    ],
)
def test_vehicles_that_cannot_be_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_a_flight_counts_that_has_a_single_tick_to_be_judged():
    start = (0.5, 0.0, 1.0)
    flights = simulate(near_hover(), CONTROLLER, x0=start, duration=0.02, settle_time=0.01)
    assert flights.largest_error == pytest.approx(0.5, abs=1e-3)
    assert flights.rms_error == flights.largest_error


class Weak(Coupled7D):
    """A model of a user: some of the thrust is lost."""

    def __init__(self, loss):
        self._loss = loss

    def rates(self, t, x, u):
        """See `Dynamics.rates`."""
        return super().rates(t, x, [*u[:3], u[3] * (1.0 - self._loss)])


class Branching(Coupled7D):
    """A model of a user that asks for a value."""

    def rates(self, t, x, u):
        """See `Dynamics.rates`."""
        return super().rates(t, x, u if x[2] > 0.5 else [0.0] * 4)


def test_a_model_of_ones_own_flies():
    flights = simulate(Model(Weak, {"loss": [0.0, 0.01]}), CONTROLLER, n=2, duration=20.0)
    # k_p (1 - loss) error = loss g at rest.
    assert flights.x[:, 2] == pytest.approx([1.0, 1.0 - 0.01 / 0.99 * 9.81 / 1.5], abs=1e-4)


def test_a_model_that_branches_is_refused():
    words = r"Branching\.rates \(.*test_simulation\.py, line \d+\) .*must not branch"
    with pytest.raises(TypeError, match=words):
        simulate(Model(Branching), CONTROLLER)


class Libm(Coupled7D):
    """A model of a user that calls math instead of `crazyflie_model.elementwise`."""

    def rates(self, t, x, u):
        """See `Dynamics.rates`."""
        return [math.sin(x[0]), *super().rates(t, x, u)[1:]]


class Remainder(Coupled7D):
    """A model of a user with an operator that symbols do not have."""

    def rates(self, t, x, u):
        """See `Dynamics.rates`."""
        return [divmod(x[0], 1.0)[1], *super().rates(t, x, u)[1:]]


@pytest.mark.parametrize("make", [Libm, Remainder])
def test_a_formula_that_cannot_be_traced_is_named(make):
    with pytest.raises(TypeError, match=rf"the formula {make.__name__}\.rates \(.*cannot be"):
        simulate(Model(make), CONTROLLER)


def test_the_code_of_the_readme_runs(capsys):
    code, *others = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    exec(code, {})
    for each in others:
        exec(each, {})
    assert re.fullmatch(r"\d+% within 10 cm\n", capsys.readouterr().out)
