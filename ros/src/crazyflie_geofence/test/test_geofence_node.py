"""The geofence's node on a fake process, and its launch files."""

import math
from pathlib import Path

import numpy as np
import pytest
import rospkg

from crazyflie_control_merger.merger_nodes import RegularControlMergerNode
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


def publish_regular(process, *values):
    process.publish("/control/lqr", ControlStamped(control=Control(*values)))


def test_answers_a_state_with_what_the_fence_says(process):
    publish_regular(process, *REGULAR)
    publish_state(process, *STATE)
    [message] = process.published("/control/geofence")
    fence = Geofence((-1.0, -2.0, 0.0), (2.0, 1.0, 3.0), 0.5, (1.5, 0.4), (4.0, 0.2), 1.0)
    x = np.array(STATE)
    control, priority = fence.control(x[:3], x[3:6], x[6], np.array(REGULAR))
    np.testing.assert_array_equal(to_vector(message.control.control), control)
    assert message.control.priority == priority > 0.5
    assert message.header.stamp.to_sec() == 12.5


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
        ("box/max/x", -0.5, "at least 0 m, which is box/min/x and twice the margin"),
        ("box/max/y", -2.0, "at least -1 m"),
        ("box/max/z", 0.9, "at least 1 m"),
        ("box/min/x", math.nan, "a finite number >= -1e+09"),
        ("margin", 0.0, ">= 0.001"),
        ("braking/horizontal", 1.9, "<= 1.85"),
        ("braking/vertical", 6.0, "<= 5.81"),
        ("reaction_time/horizontal", 0.0, ">= 0.001"),
        ("reaction_time/vertical", -0.1, ">= 0.001"),
        ("recovery_rate", 0, "> 0"),
    ],
)
def test_bad_parameters_are_named(name, value, expected):
    fake = FakeProcess()
    assert not fake.launch(GeofenceNode(), "/geofence", {**PARAMETERS, name: value})
    [error] = fake.logged("error")
    assert f"{name} is {value}; expected" in error
    assert expected in error


def test_a_wide_margin_needs_a_wide_box():
    fake = FakeProcess()
    assert not fake.launch(GeofenceNode(), "/geofence", {**PARAMETERS, "margin": 1.6})
    assert "box/max/x is 2.0; expected at least 2.2 m" in fake.logged("error")[0]


def test_the_box_may_be_changed_in_flight(process):
    publish_regular(process, *REGULAR)
    process.reconfigure("/geofence", **{"box/min/x": -9.0, "box/max/x": 9.0, "margin": 0.25})
    publish_state(process, *STATE)
    process.reconfigure("/geofence", **{"box/max/x": 1.5})
    publish_state(process, *STATE)
    priorities = [m.control.priority for m in process.published("/control/geofence")]
    assert priorities == [0.0, 1.0]


def test_a_box_that_is_too_small_is_refused(process):
    with pytest.raises(ServiceError, match="box/max/z is 3.0; expected at least 3.5 m"):
        process.reconfigure("/geofence", **{"box/min/z": 2.5})
    publish_regular(process, *REGULAR)
    publish_state(process, *STATE)
    assert process.published("/control/geofence")[0].control.priority > 0.5


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
