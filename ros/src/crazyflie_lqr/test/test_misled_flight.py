"""Flights of models on references whose velocities are wrong: none leaves, none falls."""

import math
from pathlib import Path

import pytest

from crazyflie_lqr.gain_file import load_matrix
from crazyflie_lqr.linear_feedback import IntegralStateFeedback
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_model.dynamics import STEP, Coupled7D, NearHover
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_references.governor import ReferenceGovernor

CONFIG = Path(__file__).parents[1] / "config"
PERIOD = 0.01
BEGIN = 1.0
HOVER = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)

VEHICLES = {
    "near_hover": (NearHover, "K_sim.txt", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "coupled": (Coupled7D, "K_sim.txt", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "quadrotor": (StabilizedQuadrotor, "K_quadrotor.txt", (-0.1, 0.1, -4.0), (0.5, 0.5, 0.7)),
    "soft": (StabilizedQuadrotor, "K_soft.txt", (-0.05, 0.05, -0.5), (1.0, 1.0, 6.0)),
}


def flown(vehicle, references, duration=8.0):
    """Return the states, 100 a second, of a hover that is sent references, {time: reference}."""
    make_model, gains, k, limit = VEHICLES[vehicle]
    model = make_model()
    controller = IntegralStateFeedback(
        load_matrix(str(CONFIG / gains), 4, 7), (0.0, 0.0, 0.0, 9.81), 6, k, limit
    )
    guard = ReferenceGovernor(6, 3.0, max_speed=2.0)
    guard.update([*HOVER, 0.0])
    x = model.initial_state(HOVER[:3])
    states = []
    for tick in range(round(duration / PERIOD)):
        time = tick * PERIOD
        if tick in references:
            guard.update([*references[tick], 0.0], time=time)
        yaw = x[6] if len(x) == 7 else rpy_from_quaternion(*x[6:10])[2]
        state = [*x[:6], yaw]
        states.append(state)
        u = controller.control(state, guard.value(time, state), time)
        for step in range(round(PERIOD / STEP)):
            x = model.step(round(PERIOD / STEP) * tick + step, x, u)
    return states


def once(**velocity):
    return {round(BEGIN / PERIOD): (*HOVER[:3], *map(velocity.get, "xyz", (0.0, 0.0, 0.0)))}


STREAM = {tick: (*HOVER[:3], 100.0, -100.0, 100.0) for tick in range(100, 400, 2)}


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize(
    "references",
    [once(x=5.0), once(z=5.0), once(z=-5.0), STREAM],
    ids=["x_dot", "z_dot", "down", "stream"],
)
def test_a_velocity_beside_a_point_that_stays_does_not_lead_away(vehicle, references):
    states = flown(vehicle, references)
    assert max(math.dist(state[:3], HOVER[:3]) for state in states) < 0.9
    # The estimator rejects poses of a vehicle that is faster than 5 m/s.
    assert max(math.hypot(*state[3:6]) for state in states) < 2.5
    assert min(state[2] for state in states) > 0.15
    assert math.dist(states[-1][:3], HOVER[:3]) < 0.2


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_trajectory_is_flown_with_its_velocity(vehicle):
    def there(tick):
        t = tick * PERIOD
        return 1.0 - math.cos(t), 0.0, 1.0, math.sin(t), 0.0, 0.0

    references = {tick: there(tick) for tick in range(600)}
    states = flown(vehicle, references, 6.0)
    assert max(math.dist(state[:3], there(k)[:3]) for k, state in enumerate(states)) < 0.75
