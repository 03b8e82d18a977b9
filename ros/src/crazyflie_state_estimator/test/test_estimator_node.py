"""The estimator nodes on a fake process."""

import math

import numpy as np
import pytest
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import ReconfigureRequest
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_state_estimator.estimator_node import (
    FullStateEstimatorNode,
    PositionVelocityStateEstimatorNode,
    PositionVelocityYawStateEstimatorNode,
)
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import to_vector

PARAMETERS = {
    "x_dim": 7,
    "time_step": 0.01,
    "frames/fixed": "world",
    "frames/robot": "crazyflie",
    "topics/state": "/state",
}


def launch(node_class=PositionVelocityYawStateEstimatorNode, **changes):
    """Return a process with an estimator in it."""
    process = FakeProcess()
    assert process.launch(node_class(), "/state_estimator", {**PARAMETERS, **changes})
    return process


def transform(process, position=(0.0, 0.0, 0.0), attitude=(0.0, 0.0, 0.0), frame="crazyflie"):
    """Return a transform that is stamped now."""
    message = TransformStamped(child_frame_id=frame)
    message.header.frame_id = "world"
    message.header.stamp = process.clock.stamp()
    message.transform.translation = Vector3(*position)
    message.transform.rotation = Quaternion(*quaternion_from_rpy(*attitude))
    return message


def fly(process, position, duration, period=0.01):
    """Broadcast ``position(elapsed)`` every period, each followed by a tick of the node."""
    for k in range(round(duration / period)):
        pose = transform(process, *position(k * period))
        process.publish("/tf", TFMessage([pose]))
        process.advance(period)


def moving(elapsed):
    return (1.0 + elapsed, -2.0 * elapsed, 0.5 * elapsed), (0.1, -0.2, 3.0 + elapsed)


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
def test_begins_anew_when_time_is_reset(flown):
    process = launch()
    fly(process, lambda elapsed: ((50.0, 0.0, 0.0), (0.0, 0.0, 0.0)), flown)
    process.clock.set(1.0)
    before = len(process.published("/state"))
    fly(process, moving, 0.02)
    (message,) = process.published("/state")[before:]
    assert message.header.stamp.to_sec() == pytest.approx(1.01)
    assert message.state.x_dot == pytest.approx(1.0)


@pytest.mark.parametrize("axis", ["x", "z", "yaw"])
def test_the_kalman_filter_smooths(axis):
    rng = np.random.default_rng(5)

    def noisily(elapsed):
        position, attitude = moving(elapsed)
        return position + 0.001 * rng.normal(size=3), attitude + 0.005 * rng.normal(size=3)

    def deviation(filter_type):
        process = launch(FullStateEstimatorNode, x_dim=12, **{"filter/type": filter_type})
        fly(process, noisily, 3.0)
        states = [message.state for message in process.published("/state")]
        assert len(states) == 299
        return np.std([getattr(state, f"{axis}_dot") for state in states[100:]])

    assert 3.0 * deviation("kalman") < deviation("finite_difference")


def test_the_kalman_filter_begins_with_the_second_transform():
    process = launch(**{"filter/type": "kalman"})
    fly(process, moving, 0.02)
    (message,) = process.published("/state")
    assert message.state.x_dot == pytest.approx(1.0, abs=0.01)
    assert message.state.yaw == pytest.approx(3.01)


def thrown(process, thrust):
    """Hover for a second and then accelerate upwards; return the errors of z_dot while doing so."""
    acceleration, height, speed, errors = 0.0, 1.0, 0.0, []
    for k in range(120):
        process.publish("/tf", TFMessage([transform(process, (0.0, 0.0, height))]))
        process.advance(0.01)
        if k >= 100:
            errors.append(abs(process.published("/state")[-1].state.z_dot - speed))
            acceleration = 5.0
        control = Control(thrust=thrust + acceleration)
        if "/control" in process.transport.subscribers:
            process.publish("/control", ControlStamped(control=control))
        height += 0.01 * speed + 0.5 * 0.01**2 * acceleration
        speed += 0.01 * acceleration
    return errors


def test_the_kalman_filter_uses_the_control_it_is_given():
    without = thrown(launch(**{"filter/type": "kalman"}), 9.81)
    with_control = thrown(launch(**{"filter/type": "kalman", "topics/control": "/control"}), 9.81)
    assert max(without) > 0.1
    assert max(with_control) < 0.001


def test_controls_that_are_not_finite_are_ignored():
    process = launch(**{"filter/type": "kalman", "topics/control": "/control"})
    errors = thrown(process, math.nan)
    assert max(errors) < 1.0
    (warning,) = process.logged("warn")
    assert "/control" in warning


def test_the_kalman_filter_begins_anew_when_time_is_reset():
    process = launch(**{"filter/type": "kalman", "topics/control": "/control"})
    thrown(process, 9.81)
    process.clock.set(1.0)
    before = len(process.published("/state"))
    fly(process, moving, 0.02)
    (message,) = process.published("/state")[before:]
    assert message.state.x_dot == pytest.approx(1.0, abs=0.01)


# Poses that cannot be.


def hover(process, duration, x=0.0, attitude=(0.0, 0.0, 0.0)):
    """Broadcast a pose that does not move; return the new states."""
    before = len(process.published("/state"))
    fly(process, lambda elapsed: ((x, 0.0, 1.0), attitude), duration)
    return [message.state for message in process.published("/state")[before:]]


def rejected(process):
    process.advance(1.0)
    (status,) = process.published("/diagnostics")[-1].status
    return {pair.key.removeprefix("rejected: "): int(pair.value) for pair in status.values}


def test_one_pose_elsewhere_is_passed_over():
    process = launch()
    hover(process, 0.5)
    assert hover(process, 0.01, x=0.5) == []
    (state,) = hover(process, 0.01)
    assert (state.x, state.x_dot) == (0.0, 0.0)
    assert rejected(process)["is too far away"] == 1


@pytest.mark.parametrize("speed", [4.9, 7.5])
def test_a_vehicle_may_fly_fast_but_not_faster_than_it_can(speed):
    process = launch()
    fly(process, lambda elapsed: ((speed * elapsed, 0.0, 1.0), (0.0, 0.0, 0.0)), 5.0)
    assert (rejected(process)["rejected"] > 0) == (speed > 5.0)


def test_a_vehicle_that_was_carried_is_found_again_after_three_tenths_of_a_second():
    process = launch()
    hover(process, 0.5)
    assert hover(process, 0.3, x=2.0) == []
    states = hover(process, 0.2, x=2.0)
    assert len(states) >= 18
    assert {(state.x, state.x_dot) for state in states} == {(2.0, 0.0)}


def test_poses_that_jump_to_and_fro_are_not_believed():
    process = launch()
    hover(process, 0.5)
    before = len(process.published("/state"))
    rng = np.random.default_rng(1)
    fly(process, lambda elapsed: ((5.0, *rng.uniform(2.0, 9.0, 2)), (0.0, 0.0, 0.0)), 2.0)
    assert len(process.published("/state")) == before


def test_a_pose_from_the_future_does_not_silence_it():
    process = launch()
    hover(process, 0.5)
    early = transform(process, (0.0, 0.0, 1.0))
    early.header.stamp = process.clock.stamp(process.clock.time() + 8.0)
    process.publish("/tf", TFMessage([early]))
    assert len(hover(process, 0.5)) == 50
    assert rejected(process)["is stamped in the future"] == 1


def test_stamps_that_step_back_do_not_silence_it():
    process = launch()
    hover(process, 5.0)
    before = len(process.published("/state"))
    for _ in range(50):
        late = transform(process, (0.0, 0.0, 1.0))
        late.header.stamp = process.clock.stamp(process.clock.time() - 3.0)
        process.publish("/tf", TFMessage([late]))
        process.advance(0.01)
    states = [message.state for message in process.published("/state")[before:]]
    assert len(states) >= 45
    assert max(abs(state.z_dot) for state in states) < 1e-9
    assert rejected(process)["is stamped in the past"] == 2


def test_when_nothing_good_comes_it_is_silent_and_says_why():
    process = launch()
    hover(process, 0.5)
    before = len(process.published("/state"))
    for _ in range(100):
        process.publish("/tf", TFMessage([transform(process, (math.nan, 0.0, 0.0))]))
        process.advance(0.01)
    assert len(process.published("/state")) == before
    assert rejected(process)["is not finite"] == 100
    (status,) = process.published("/diagnostics")[-1].status
    assert status.level == 2
    assert "no state for" in status.message
    assert any("poses were rejected" in text for text in process.logged("warn"))


# Tipping over.


def tilted(process):
    return [message.data for message in process.published("/state_tilted")]


@pytest.mark.parametrize(
    ("attitude", "is_crash"),
    [
        ((1.04, 0.0, 2.0), False),
        ((0.0, -1.06, 0.5), True),
        ((1.06, 0.0, 0.0), True),
        ((0.9, 0.9, 0.0), True),
        ((3.1, 0.0, 0.0), True),
        ((0.0, 0.0, 3.0), False),
    ],
)
def test_tells_when_the_vehicle_has_tipped_over_and_when_it_stands_again(attitude, is_crash):
    process = launch()
    hover(process, 0.1)
    hover(process, 0.1, attitude=attitude)
    hover(process, 0.1)
    assert tilted(process) == [False, True, False] if is_crash else [False]


def test_a_marker_that_was_mistaken_is_no_crash():
    process = launch()
    for _ in range(10):
        hover(process, 0.1)
        hover(process, 0.02, attitude=(2.0, 0.0, 0.0))
    assert tilted(process) == [False]


# Changes in flight.


def reconfigure(process, **values):
    """Change parameters as dynamic_reconfigure does."""
    request = ReconfigureRequest(encode_config(values))
    return process.call("/state_estimator/set_parameters", request)


def test_a_change_of_the_filter_keeps_what_it_knows():
    changed, unchanged = (launch(**{"filter/type": "kalman"}) for _ in range(2))
    for process in (changed, unchanged):
        fly(process, moving, 1.0)
    reconfigure(changed, **{"filter/position_noise": 0.02, "filter/acceleration_walk": 0.5})
    for process in (changed, unchanged):
        fly(process, lambda elapsed: moving(1.0 + elapsed), 0.05)
        speeds = [message.state.x_dot for message in process.published("/state")[-5:]]
        assert speeds == pytest.approx([1.0] * 5, abs=1e-6)


def test_a_changed_filter_smooths_more():
    def jump(**changes):
        process = launch(**{"filter/type": "kalman"})
        fly(process, moving, 1.0)
        reconfigure(process, **changes)
        process.publish("/tf", TFMessage([transform(process, (2.02, -2.0, 0.5))]))
        process.advance(0.01)
        return process.published("/state")[-1].state.x_dot - 1.0

    assert 0.0 < jump(**{"filter/position_noise": 0.1}) < 0.5 * jump()


@pytest.mark.parametrize(("changes", "walk"), [({}, 3.0), ({"topics/control": "/control"}, 1.0)])
def test_the_walk_that_is_offered_depends_on_the_control(changes, walk):
    process = launch(**{"filter/type": "kalman"}, **changes)
    response = reconfigure(process, **{"filter/angle_noise": 0.01})
    doubles = {parameter.name: parameter.value for parameter in response.config.doubles}
    assert doubles["filter/acceleration_walk"] == walk


@pytest.mark.parametrize(
    ("name", "value"), [("filter/position_noise", 0.0), ("filter/type", "finite_difference")]
)
def test_bad_changes_are_refused(name, value):
    process = launch(**{"filter/type": "kalman"})
    with pytest.raises(ServiceError, match=name):
        reconfigure(process, **{name: value})


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
