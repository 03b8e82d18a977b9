"""The estimator nodes on a fake process."""

import math
import re

import numpy as np
import pytest
from estimator_helpers import PARAMETERS, fly, launch, moving, transform
from geometry_msgs.msg import Quaternion
from tf2_msgs.msg import TFMessage

from crazyflie_state_estimator.estimator_node import (
    FullStateEstimatorNode,
    PositionVelocityStateEstimatorNode,
    PositionVelocityYawStateEstimatorNode,
)
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import to_vector


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_is_required(name):
    process = FakeProcess()
    parameters = {key: value for key, value in PARAMETERS.items() if key != name}
    node = PositionVelocityYawStateEstimatorNode()
    assert not process.launch(node, "/state_estimator", parameters)
    assert f"/state_estimator/{name} is not set" in process.logged("error")[0]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("x_dim", 6),
        ("x_dim", "seven"),
        ("time_step", 0.0),
        ("time_step", -0.01),
        ("time_step", math.nan),
        ("frames/fixed", ""),
        ("frames/robot", 1),
        ("topics/state", "/st ate"),
        ("filter/type", "median"),
        ("filter/position_noise", 0.0),
        ("filter/angle_noise", "small"),
        ("filter/acceleration_walk", -1.0),
        ("filter/angular_acceleration_walk", math.inf),
        ("topics/control", 5),
    ],
)
def test_bad_parameters_are_named(name, value):
    process = FakeProcess()
    node = PositionVelocityYawStateEstimatorNode()
    parameters = {**PARAMETERS, "filter/type": "kalman", name: value}
    assert not process.launch(node, "/state_estimator", parameters)
    assert f"/state_estimator/{name} is" in process.logged("error")[0]
    assert "expected" in process.logged("error")[0]


@pytest.mark.parametrize("start", [5000.0, 1795944674.8])
def test_silence_begins_with_simulated_time_wherever_that_begins(start):
    """As a bag that is played, or a simulation that runs already."""
    process = FakeProcess(start=0.0)
    process.launch(PositionVelocityYawStateEstimatorNode(), "/state_estimator", PARAMETERS)
    process.set_clock(start)
    assert process.logged("warn") == []
    process.advance(1.0)
    assert process.logged("warn")
    for text in process.logged("warn"):
        assert re.search(r"no new transform world -> \w+ for (0\.[5-9]|1\.0) s", text)


def test_that_nothing_is_missing_is_published_as_others_may_have_an_old_reason():
    process = launch()
    fly(process, moving, 0.1)
    assert {each.reason for each in process.published("/state_status")} == {""}


def test_publishes_the_state_with_the_transforms_stamp_and_frame():
    process = launch()
    start = process.clock.time()
    fly(process, moving, 1.0)
    messages = process.published("/state")
    assert [message.header.stamp.to_sec() for message in messages] == pytest.approx(
        [start + 0.01 * k for k in range(1, 100)]
    )
    assert {message.header.frame_id for message in messages} == {"world"}
    state = messages[-1].state
    assert (state.x, state.y, state.z) == pytest.approx((1.99, -1.98, 0.495))
    assert (state.x_dot, state.y_dot, state.z_dot) == pytest.approx((1.0, -2.0, 0.5))
    assert state.yaw == pytest.approx(3.99 - 2.0 * math.pi)


@pytest.mark.parametrize(
    ("node_class", "fields"),
    [
        (PositionVelocityStateEstimatorNode, "x y z x_dot y_dot z_dot"),
        (PositionVelocityYawStateEstimatorNode, "x y z x_dot y_dot z_dot yaw"),
        (
            FullStateEstimatorNode,
            "x y z x_dot y_dot z_dot roll pitch yaw roll_dot pitch_dot yaw_dot",
        ),
    ],
)
def test_each_node_fills_every_field_of_its_state(node_class, fields):
    rates = {"x": 0.5, "y": -1.0, "z": 0.25, "roll": 0.3, "pitch": -0.2, "yaw": 1.5}

    def signals(elapsed):
        values = [rate * elapsed for rate in rates.values()]
        return values[:3], values[3:]

    names = fields.split()
    process = launch(node_class, x_dim=len(names))
    fly(process, signals, 0.51)
    state = process.published("/state")[-1].state
    values = {name: 0.5 * rate for name, rate in rates.items()}
    values |= {f"{name}_dot": rate for name, rate in rates.items()}
    assert list(state.__slots__) == names
    assert to_vector(state) == pytest.approx([values[name] for name in names])


@pytest.mark.parametrize(
    ("node_class", "x_dim"),
    [(PositionVelocityStateEstimatorNode, 7), (FullStateEstimatorNode, 7)],
)
def test_each_node_has_its_own_x_dim(node_class, x_dim):
    process = FakeProcess()
    assert not process.launch(node_class(), "/state_estimator", {**PARAMETERS, "x_dim": x_dim})
    assert "/state_estimator/x_dim is 7; expected the integer" in process.logged("error")[0]


def test_stamps_count_not_the_moments_of_reading():
    process = launch(time_step=0.013)
    fly(process, moving, 1.0, period=0.003)
    speeds = [message.state.x_dot for message in process.published("/state")]
    assert len(speeds) == 75
    assert speeds == pytest.approx([1.0] * 75)


def test_a_transform_that_repeats_gives_no_state():
    process = launch()
    fly(process, moving, 0.1, period=0.05)
    process.advance(0.3)
    assert len(process.published("/state")) == 1
    assert process.published("/state")[0].state.x_dot == pytest.approx(1.0)
    assert process.logged("warn") == []


def test_transforms_that_stop_are_reported():
    process = launch()
    fly(process, moving, 0.1)
    process.advance(2.0)
    assert len(process.published("/state")) == 9
    (warning,) = process.logged("warn")
    assert "world -> crazyflie" in warning


def test_a_frame_that_never_appears_is_reported_by_name():
    process = launch()
    process.publish("/tf", TFMessage([transform(process, frame="another")]))
    process.advance(2.0)
    assert process.published("/state") == []
    (warning,) = process.logged("warn")
    assert "world -> crazyflie" in warning


def test_bad_transforms_are_passed_over():
    process = launch()
    fly(process, moving, 0.1)
    bad = transform(process, position=(math.nan, 0.0, 0.0))
    unturned = transform(process)
    unturned.transform.rotation = Quaternion(0.0, 0.0, 0.0, 0.0)
    process.publish("/tf", TFMessage([bad, unturned]))
    process.advance(0.1)
    assert len(process.published("/state")) == 9
    assert process.logged("error") == []


@pytest.mark.parametrize("flown", [0.01, 0.1])
def test_restarts_when_time_is_reset(flown):
    process = launch()
    fly(process, lambda elapsed: ((50.0, 0.0, 0.0), (0.0, 0.0, 0.0)), flown)
    process.clock.set(1.0)
    before = len(process.published("/state"))
    fly(process, moving, 0.02)
    (message,) = process.published("/state")[before:]
    assert message.header.stamp.to_sec() == pytest.approx(1.01)
    assert message.state.x_dot == pytest.approx(1.0)


# Acting on arrival.


def stamps(process):
    """Return the stamps of the states, s since the beginning."""
    return [state.header.stamp.to_sec() - 100.0 for state in process.published("/state")]


@pytest.mark.parametrize("rate", [1000, 300, 100])
def test_on_arrival_a_state_comes_with_its_pose_so_often_as_before(rate):
    process = launch(act_on_arrival=True)
    for k in range(1, rate + 1):
        process.advance(100.0 + k / rate - process.clock.time())
        before = len(process.published("/state"))
        process.publish("/tf", TFMessage([transform(process, *moving(k / rate))]))
        for state in process.published("/state")[before:]:
            assert state.header.stamp == process.clock.stamp()
    assert len(stamps(process)) == pytest.approx(99, abs=1)
    assert max(np.diff(stamps(process))) < 0.01 + 1.0 / rate


def test_on_arrival_slow_poses_are_all_answered():
    process = launch(act_on_arrival=True)
    for k in range(50):
        process.advance(0.033 if k % 3 else 0.021)
        process.publish("/tf", TFMessage([transform(process, *moving(0.02 * k))]))
    assert len(stamps(process)) == 49


def test_on_arrival_time_that_is_set_back_is_followed():
    process = launch(act_on_arrival=True)
    fly(process, moving, 0.5)
    process.clock.set(50.0)
    fly(process, moving, 0.5)
    assert stamps(process)[-1] == pytest.approx(-49.51)


def test_on_arrival_silence_is_told_of():
    process = launch(act_on_arrival=True)
    fly(process, moving, 0.5)
    process.advance(1.0)
    assert any("no state" in text for text in process.logged("warn"))
