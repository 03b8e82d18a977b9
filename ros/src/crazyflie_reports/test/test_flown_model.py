"""A model that flies in place of a recorded vehicle, in the recorded wind."""

import math

import numpy as np
import pytest

from crazyflie_model.dynamics import STEP
from crazyflie_model.units import GRAVITY
from crazyflie_reports.bag_flights import Vehicle
from crazyflie_reports.figures import Figure
from crazyflie_reports.flown_model import FlownModel, VehicleModel, explain
from crazyflie_reports.what_if import Change

START, DURATION = 1_790_000_000.0, 12.0
MODELS = ["near_hover", "coupled_7d", "cf21"]


def control(t):
    """Return roll, pitch, yaw rate and thrust at a time, with steps at every 10 ms."""
    t = math.floor(t / 0.01 + 1e-6) * 0.01
    wave = math.sin(2.0 * t)
    return [0.05 * wave, -0.04 * math.cos(3.0 * t), 0.3 * wave, GRAVITY + 0.3 * math.cos(2.0 * t)]


def wind(t):
    """Return an acceleration (m/s^2) that no model knows."""
    return [0.4, -0.3 * math.sin(1.5 * t), 0.1]


def recorded(name, noise=0.0):
    """Return a vehicle that has flown as a model does, in the wind, and its positions (m)."""
    model = VehicleModel.of(name, False)
    x = model.dynamics.initial_state([0.0, 0.0, 3.0])
    poses, controls = [], []
    random = np.random.default_rng(1)
    for step in range(round(DURATION / STEP)):
        t = step * STEP
        if step % 10 == 0:
            (position, _), yaw = model.dynamics.pose(x, control(t)), x[8 if len(x) > 7 else 6]
            measured = np.array(position) + random.normal(0.0, 1.0, 3) * noise
            poses.append([START + t, *measured, 0.0, 0.0, yaw])
            controls.append([START + t, *control(t)])
        x = model.dynamics.step(step, x, control(t))
        x[3:6] = [v + a * STEP for v, a in zip(x[3:6], wind(t), strict=True)]
    none = np.empty((0, 8))
    return model, Vehicle(
        name="cf1", namespace="cf1", is_driven=False, state=none, stamps=none, reference=none,
        control=np.array(controls), command=np.empty((0, 5)), attitude=np.array(poses),
        pose_stamps=none, true_pose=none, battery=none, link=none, toggles=none, flight_states=[],
        delays=none, lost=None,
    )  # fmt: skip


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize(("noise", "tolerance"), [(0.0, 0.06), (0.0002, 0.1)])
def test_what_the_model_does_not_explain_is_the_wind(name, noise, tolerance):
    model, vehicle = recorded(name, noise)
    found = explain(model, vehicle, START, START + DURATION)
    # In the first second a model of first order has not yet the vehicle's attitude.
    inner = slice(100, -20)
    expected = np.array([wind(t - START) for t in found.times])
    assert np.abs(found.wind[inner] - expected[inner]).max() < tolerance
    assert found.rms == pytest.approx(np.sqrt((expected**2).sum(axis=1).mean()), rel=0.1)


@pytest.mark.parametrize("name", MODELS)
def test_the_same_controls_lead_to_the_same_places(name):
    model, vehicle = recorded(name)
    found = explain(model, vehicle, START, START + DURATION)
    begin = START + 3.0
    flown = FlownModel(model, found, begin)
    errors = []
    for time, *position in vehicle.attitude[300:800, :4]:
        place, _ = flown.pose(time)
        errors.append(math.dist(place, position))
        flown.command(control(time - START), time)
    # 5 s after, in open loop.
    assert max(errors) < 0.02
    assert errors[0] < 1e-3


def test_a_pose_between_two_steps_is_not_rounded():
    model, vehicle = recorded("near_hover")
    flown = FlownModel(model, explain(model, vehicle, START, START + DURATION), START + 3.0)
    first, _ = flown.pose(START + 3.1)
    second, _ = flown.pose(START + 3.1004)
    speed = math.dist(first, second) / 0.0004
    assert speed == pytest.approx(np.linalg.norm(flown._x[3:6]), rel=0.01)
    assert speed > 0.1


def test_without_poses_or_controls_nothing_is_explained():
    model, vehicle = recorded("near_hover")
    assert explain(model, vehicle, START - 100.0, START - 50.0) is None
    vehicle.control = vehicle.control[:0]
    assert explain(model, vehicle, START, START + DURATION) is None


@pytest.mark.parametrize(
    ("before", "after", "is_worse"),
    [(20, 40, False), (20, 101, True), (120, 110, False), (120, 130, True), (20, math.nan, True),
     (math.nan, 101, True), (math.nan, math.nan, False)],
)  # fmt: skip
def test_a_figure_is_worse_if_it_leaves_what_is_normal(before, after, is_worse):
    figures = [Figure("rms", "mm", float(value), "", maximum=100.0) for value in (before, after)]
    assert Change(*figures).is_worse == is_worse
