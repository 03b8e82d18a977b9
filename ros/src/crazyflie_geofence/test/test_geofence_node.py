"""The geofence's node on a fake process, and its launch files."""

import math
from pathlib import Path

import numpy as np
import pytest
import rospkg
from diagnostic_msgs.msg import DiagnosticStatus

from crazyflie_control_merger.merger_nodes import RegularControlMergerNode
from crazyflie_geofence import bounds
from crazyflie_geofence.geofence import Geofence
from crazyflie_geofence.geofence_node import GeofenceNode
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.testing import FakeProcess, launch_files
from crazyflie_utils.vectors import to_vector

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_examples")) / "launch"
PARAMETERS = {
    "topics/state": "/state",
    "topics/control": "/control/lqr",
    "topics/prioritized_control": "/control/geofence",
    **{f"box/min/{axis}": value for axis, value in zip("xyz", (-1.0, -2.0, 0.0), strict=True)},
    **{f"box/max/{axis}": value for axis, value in zip("xyz", (2.0, 1.0, 3.0), strict=True)},
}
STATE = (1.9, 0.2, 1.0, 0.3, -0.1, 0.0, 0.4)
REGULAR = (0.05, 0.2, -0.3, 10.5)


@pytest.fixture
def process():
    fake = FakeProcess()
    assert fake.launch(GeofenceNode(), "/geofence", PARAMETERS), fake.logged("error")
    return fake


def publish_state(process, *values, stamp=12.5):
    message = PositionVelocityYawStateStamped(state=PositionVelocityYawState(*values))
    message.header.stamp = process.clock.stamp(stamp)
    process.publish("/state", message)


def publish_regular(process, *values, stamp=0.0):
    message = ControlStamped(control=Control(*values))
    message.header.stamp = process.clock.stamp(stamp)
    process.publish("/control/lqr", message)


def test_answers_a_state_with_what_the_fence_says(process):
    publish_regular(process, *REGULAR)
    publish_state(process, *STATE)
    [message] = process.published("/control/geofence")
    axes = bounds.axes(bounds.load("cf21"), 1.4, 2.0, 0.01, 0.01)
    fence = Geofence((-1.0, -2.0, 0.0), (2.0, 1.0, 3.0), axes, bounds.max_thrust("cf21"))
    control, priority = fence.control(0.0, STATE[:3], STATE[3:6], STATE[6], REGULAR)
    np.testing.assert_array_equal(to_vector(message.control.control), control)
    assert message.control.priority == priority == 1.0
    assert message.header.stamp.to_sec() == 12.5


def test_a_controller_that_answers_each_state_is_waited_for(process):
    """Near a wall the vehicle would have its regular control of the state before, otherwise."""

    def answers():
        return [
            (m.header.stamp.to_sec(), m.control.control.yaw_dot)
            for m in process.published("/control/geofence")
        ]

    publish_state(process, *STATE, stamp=1.0)
    publish_regular(process, *REGULAR[:2], 0.1, 9.81, stamp=1.0)
    publish_state(process, *STATE, stamp=2.0)
    assert answers() == [(1.0, 0.1)]
    publish_regular(process, *REGULAR[:2], 0.2, 9.81, stamp=2.0)
    assert answers()[1:] == [(2.0, 0.2)]
    # It has answered first.
    publish_regular(process, *REGULAR[:2], 0.3, 9.81, stamp=3.0)
    publish_state(process, *STATE, stamp=3.0)
    assert answers()[2:] == [(3.0, 0.3)]
    # It is waited for once, until it answers again.
    for stamp in (4.0, 5.0, 6.0):
        publish_state(process, *STATE, stamp=stamp)
    assert answers()[3:] == [(5.0, 0.3), (6.0, 0.3)]
    publish_regular(process, *REGULAR[:2], 0.6, 9.81, stamp=6.0)
    publish_state(process, *STATE, stamp=7.0)
    assert len(answers()) == 5
    # Of whatever state, it is the newest.
    publish_regular(process, *REGULAR[:2], 0.7, 9.81, stamp=6.5)
    assert answers()[5:] == [(7.0, 0.7)]


def test_what_was_sent_while_it_was_waited_for_is_not_in_force_at_once():
    """The prediction begins with the state, and what was sent since is replaced by the answer."""
    answers = []
    for is_sent in (False, True):
        fake, others = FakeProcess(), {"topics/final_control": "/sent"}
        assert fake.launch(GeofenceNode(), "/geofence", {**PARAMETERS, **others})
        publish_state(fake, 1.85, *STATE[1:3], 0.2, *STATE[4:], stamp=1.0)
        fake.advance(0.002)
        if is_sent:
            fake.publish("/sent", ControlStamped(control=Control(0.2, 0.2, 0.0, 12.0)))
        publish_regular(fake, *REGULAR, stamp=1.0)
        answers += [m.control.control for m in fake.published("/control/geofence")]
    assert answers[0] == answers[1] != Control(*REGULAR)


def test_in_the_middle_the_regular_control_is_untouched(process):
    publish_regular(process, *REGULAR)
    publish_state(process, 0.5, -0.5, 1.5, 0.1, -0.1, 0.0, 0.4)
    [message] = process.published("/control/geofence")
    assert message.control.control == Control(*REGULAR)
    assert message.control.priority == 0.0


def test_is_silent_without_a_regular_control(process):
    publish_state(process, *STATE)
    assert process.published("/control/geofence") == []


def test_what_is_not_finite_is_ignored(process):
    publish_regular(process, *REGULAR)
    publish_regular(process, 0.0, math.nan, 0.0, 9.81)
    publish_state(process, math.inf, *STATE[1:])
    assert process.published("/control/geofence") == []
    publish_state(process, *STATE)
    assert process.published("/control/geofence")[0].control.control.yaw_dot == REGULAR[2]
    control, state = process.logged("warn")
    assert "/control/lqr" in control
    assert "/state" in state


@pytest.mark.parametrize("name", PARAMETERS)
def test_topics_and_box_are_required(name):
    fake = FakeProcess()
    parameters = {key: value for key, value in PARAMETERS.items() if key != name}
    assert not fake.launch(GeofenceNode(), "/geofence", parameters)
    assert f"/geofence/{name} is not set" in fake.logged("error")[0]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("box/max/x", -0.5, "at least -0.007849 m: the proof needs 0.99 m between the walls"),
        ("box/max/y", -2.0, "at least -1.008 m"),
        ("box/max/z", 0.3, "at least 0.4126 m: the proof needs 0.41 m"),
        ("box/min/x", math.nan, "a finite number >= -1e+09"),
        ("braking/horizontal", 1.5, "at most 1.429 m/s^2"),
        ("braking/vertical", 3.5, "at most 3.2"),
        ("bounds/lag/horizontal", 0.0, ">= 0.001"),
        ("bounds/delay", -0.1, ">= 0"),
        ("period", 0, ">= 0.001"),
    ],
)
def test_bad_parameters_are_named(name, value, expected):
    fake = FakeProcess()
    assert not fake.launch(GeofenceNode(), "/geofence", {**PARAMETERS, name: value})
    [error] = fake.logged("error")
    assert f"{name} is {value}; expected" in error
    assert expected in error


@pytest.mark.parametrize(
    ("name", "axis", "braking"),
    [("horizontal", "x", 1.4), ("vertical", "z", 2.0)],
)
def test_a_disturbance_that_braking_does_not_exceed_is_refused(name, axis, braking):
    fake = FakeProcess()
    parameters = {**PARAMETERS, f"bounds/disturbance/{name}": braking}
    assert not fake.launch(GeofenceNode(), "/geofence", parameters)
    expected = f"the disturbance along {axis} is {braking:g} m/s^2; expected less than the braking"
    assert expected in fake.logged("error")[0]


def test_a_model_file_without_bounds_is_refused(tmp_path):
    model = tmp_path / "mine.yaml"
    model.write_text("type: cf21plus\nmass: 0.03\n")
    fake = FakeProcess()
    assert not fake.launch(GeofenceNode(), "/geofence", {**PARAMETERS, "model": str(model)})
    [error] = fake.logged("error")
    assert "bounds/lag/horizontal is not known" in error
    assert "has no identified/bounds/lag/horizontal" in error


def test_bounds_of_a_model_file_count_and_parameters_before_them(tmp_path):
    model = tmp_path / "mine.yaml"
    model.write_text(
        "type: cf21plus\nidentified:\n  bounds:\n    lag: {horizontal: 0.2, vertical: 0.05}\n"
        "    delay: 0.03\n    disturbance: {horizontal: 0.3, vertical: 0.4}\n"
        "    error: {position: 0.001, velocity: 0.02}\n    seconds: 31.0\n"
    )
    parameters = {**PARAMETERS, "model": str(model), "bounds/delay": 0.04}
    node, fake = GeofenceNode(), FakeProcess()
    assert fake.launch(node, "/geofence", parameters), fake.logged("error")
    x, _, z = node._parameters.axes
    assert (x.tau, x.disturbance, x.delay, x.position_error, x.velocity_error) == (
        0.2,
        0.3,
        0.04,
        0.001,
        0.02,
    )
    assert (z.tau, z.disturbance) == (0.05, 0.4)


def test_the_box_may_be_changed_in_flight(process):
    publish_regular(process, *REGULAR)
    process.reconfigure("/geofence", **{"box/min/x": -9.0, "box/max/x": 9.0})
    publish_state(process, *STATE)
    process.reconfigure("/geofence", **{"box/max/x": 1.5})
    publish_state(process, *STATE)
    priorities = [m.control.priority for m in process.published("/control/geofence")]
    assert priorities == [0.0, 1.0]


def test_diagnostics_say_when_the_box_is_not_certain(process):
    """A wind of 1 m/s^2 that nothing explains, beyond the bound of 0.6 m/s^2."""
    publish_regular(process, 0.0, 0.0, 0.0, 9.81)
    for k in range(105):
        publish_state(process, 0.5, -0.5, 1.5, 0.0, 0.01 * k - 0.5, 0.0, 0.0)
        process.advance(0.01)
    status = process.published("/diagnostics")[-1].status[0]
    assert status.name == "geofence: certificate"
    assert status.level == DiagnosticStatus.WARN
    assert "the box is not certain: disturbance along y 0.8 m/s^2, bound 0.6" in status.message
    for _ in range(600):
        publish_state(process, 0.5, -0.5, 1.5, 0.0, 0.5, 0.0, 0.0)
        process.advance(0.01)
    assert process.published("/diagnostics")[-1].status[0].level == DiagnosticStatus.OK


def test_a_box_that_is_too_small_is_refused(process):
    with pytest.raises(ServiceError, match="box/max/z is 3.0; expected at least 3.213 m"):
        process.reconfigure("/geofence", **{"box/min/z": 2.8})
    publish_regular(process, *REGULAR)
    publish_state(process, *STATE)
    assert process.published("/control/geofence")[0].control.priority == 1.0


def test_stands_between_controller_and_takeoff_filter():
    nodes, parameters = launch_files.expand(LAUNCH / "sw_geofence.launch", rviz="false")
    assert {"/geofence", "/control_merger", "/simulator", "/takeoff_server"} <= set(nodes)
    merged = parameters["/control_merger/topics/merged"]
    assert merged == parameters["/takeoff_control_filter/topics/commanded_control"]
    assert merged != parameters["/lqr_controller/topics/control"]
    for reader in ("/control_merger", "/geofence"):
        assert (
            parameters[f"{reader}/topics/control"] == parameters["/lqr_controller/topics/control"]
        )


def test_one_process_has_fence_and_merger():
    _, parameters = launch_files.expand(
        LAUNCH / "sw_geofence.launch", rviz="false", composed="true", sim_time="true"
    )
    classes = NODE_CLASSES(launch_files.composed_nodes(parameters))
    assert classes["geofence"] is GeofenceNode
    assert classes["control_merger"] is RegularControlMergerNode
    process = FakeProcess(parameters)
    for name, node_class in classes.items():
        assert process.launch(node_class(), f"/{name}"), process.logged("error")
