"""Both mergers on a fake process."""

import math

import numpy as np
import pytest
from rospy import Time

from crazyflie_control_merger.merger_nodes import NoYawMergerNode, RegularControlMergerNode
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    NoYawControl,
    NoYawControlStamped,
    PrioritizedControl,
    PrioritizedControlStamped,
)
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import to_vector

NODES = [RegularControlMergerNode, NoYawMergerNode]
PARAMETERS = {
    "topics/control": "/control/lqr",
    "topics/prioritized_control": "/control/prioritized",
    "topics/merged": "/control/merged",
    "mode": "MERGE",
}
REGULAR = (0.1, -0.2, 0.3, 9.0)
PUSH = (-0.1, 0.2, 1.0, 13.0)


@pytest.fixture(params=NODES, ids=lambda node: node.__name__)
def node_class(request):
    """Return a class of mergers."""
    return request.param


def launch(node_class, mode="MERGE"):
    """Return a process with a merger in it."""
    process = FakeProcess()
    assert process.launch(node_class(), "/merger", {**PARAMETERS, "mode": mode})
    return process


def expected(node_class, priority):
    """Return the merged control."""
    u = (1.0 - priority) * np.array(REGULAR) + priority * np.array(PUSH)
    if node_class is NoYawMergerNode:
        u[2] = REGULAR[2]
    return u


def push(process, node_class, priority, control=PUSH):
    """Send a prioritised control."""
    if node_class is NoYawMergerNode:
        roll, pitch, _, thrust = control
        message = NoYawControlStamped(control=NoYawControl(roll, pitch, thrust, priority))
    else:
        prioritized = PrioritizedControl(Control(*control), priority)
        message = PrioritizedControlStamped(control=prioritized)
    process.publish("/control/prioritized", message)


def test_a_prioritised_control_is_published_at_once(node_class):
    process = launch(node_class)
    push(process, node_class, 1.0)
    assert process.published("/control/merged") == []
    answer(process)
    process.advance(0.06)
    push(process, node_class, 0.0)
    assert len(process.published("/control/merged")) == 1
    push(process, node_class, 0.5)
    merged = process.published("/control/merged")[1:]
    (control,) = (to_vector(each.control) for each in merged)
    np.testing.assert_allclose(control, expected(node_class, 0.5))
    # The regular controller has died.
    process.advance(0.06)
    push(process, node_class, 1.0)
    assert len(process.published("/control/merged")) == 2


def test_the_stamp_is_the_newer_one(node_class):
    process = launch(node_class)
    answer(process)
    push(process, node_class, 1.0)
    first, second = process.published("/control/merged")
    assert second.header.stamp == first.header.stamp > Time()


def test_a_prioritised_control_without_effect_is_not_published(node_class):
    process = launch(node_class, "LQR")
    answer(process)
    push(process, node_class, 1.0)
    assert len(process.published("/control/merged")) == 1


def answer(process, control=REGULAR):
    """Send a regular control stamped now; return what is published upon it, as vectors."""
    before = len(process.published("/control/merged"))
    message = ControlStamped(control=Control(*control))
    message.header.stamp = process.clock.stamp()
    process.publish("/control/lqr", message)
    return [to_vector(m.control) for m in process.published("/control/merged")[before:]]


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_is_required(node_class, name):
    process = FakeProcess()
    parameters = {key: value for key, value in PARAMETERS.items() if key != name}
    assert not process.launch(node_class(), "/merger", parameters)
    assert f"/merger/{name} is not set" in process.logged("error")[0]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mode", "merge"),
        ("mode", "BOTH"),
        ("mode", 1),
        ("topics/merged", ""),
        ("topics/control", 2),
    ],
)
def test_bad_parameters_are_named(node_class, name, value):
    process = FakeProcess()
    assert not process.launch(node_class(), "/merger", {**PARAMETERS, name: value})
    assert f"/merger/{name} is {value!r}; expected" in process.logged("error")[0]


@pytest.mark.parametrize(
    ("mode", "priority", "weight"),
    [("MERGE", 0.25, 0.25), ("MERGE", 1.0, 1.0), ("LQR", 0.25, 0.0), ("PRIORITIZED", 0.25, 1.0)],
)
def test_modes(node_class, mode, priority, weight):
    process = launch(node_class, mode)
    push(process, node_class, priority)
    [control] = answer(process)
    np.testing.assert_allclose(control, expected(node_class, weight))


@pytest.mark.parametrize("mode", ["MERGE", "LQR", "PRIORITIZED"])
def test_silent_until_a_regular_control_has_arrived(node_class, mode):
    process = launch(node_class, mode)
    for _ in range(3):
        push(process, node_class, 1.0)
        process.advance(0.1)
    assert process.published("/control/merged") == []


@pytest.mark.parametrize("mode", ["MERGE", "LQR", "PRIORITIZED"])
def test_regular_controls_pass_while_there_is_no_prioritized_one(node_class, mode):
    [control] = answer(launch(node_class, mode))
    np.testing.assert_array_equal(control, REGULAR)


def test_each_regular_control_is_answered_once_with_its_stamp(node_class):
    process = launch(node_class)
    for _ in range(3):
        process.advance(0.1)
        push(process, node_class, 0.5)
        assert len(answer(process)) == 1
        stamp = process.published("/control/merged")[-1].header.stamp
        assert stamp == process.clock.stamp()


@pytest.mark.parametrize("mode", ["MERGE", "PRIORITIZED"])
def test_a_prioritized_control_gets_stale(node_class, mode):
    process = launch(node_class, mode)
    push(process, node_class, 1.0)
    process.advance(0.49)
    np.testing.assert_allclose(answer(process), [expected(node_class, 1.0)])
    process.advance(0.02)
    np.testing.assert_allclose(answer(process), [REGULAR])
    push(process, node_class, 1.0)
    np.testing.assert_allclose(answer(process), [expected(node_class, 1.0)])


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_prioritized_controls_that_are_not_finite_are_ignored(node_class, bad):
    process = launch(node_class)
    push(process, node_class, 0.5)
    for _ in range(6):
        process.advance(0.05)
        push(process, node_class, 0.5, (bad, 0.0, 0.0, 9.81))
        push(process, node_class, 0.5, (0.0, 0.0, 0.0, bad))
        push(process, node_class, bad)
    np.testing.assert_allclose(answer(process), [expected(node_class, 0.5)])
    process.advance(0.21)
    push(process, node_class, bad)
    np.testing.assert_allclose(answer(process), [REGULAR])
    [warning] = process.logged("warn")
    assert "/merger" in warning and "/control/prioritized" in warning


def test_regular_controls_that_are_not_finite_are_ignored(node_class):
    process = launch(node_class)
    push(process, node_class, 0.5)
    for index in range(4):
        control = list(REGULAR)
        control[index] = math.nan
        assert answer(process, control) == []
    [warning] = process.logged("warn")
    assert "/control/lqr" in warning
    assert len(answer(process)) == 1


@pytest.mark.parametrize(("priority", "weight"), [(-0.1, 0.0), (1.1, 1.0)])
def test_priorities_out_of_range_are_clipped_with_a_warning(node_class, priority, weight):
    process = launch(node_class)
    for _ in range(3):
        push(process, node_class, priority)
    np.testing.assert_allclose(answer(process), [expected(node_class, weight)])
    [warning] = process.logged("warn")
    assert f"is {priority:g}; expected 0 ... 1" in warning


def test_the_mode_may_be_changed_in_flight(node_class):
    process = launch(node_class)
    push(process, node_class, 0.25)
    for mode, weight in [("PRIORITIZED", 1.0), ("LQR", 0.0), ("MERGE", 0.25)]:
        process.reconfigure("/merger", mode=mode)
        np.testing.assert_allclose(answer(process), [expected(node_class, weight)])


def test_a_mode_that_there_is_not_is_refused(node_class):
    process = launch(node_class, "LQR")
    push(process, node_class, 1.0)
    with pytest.raises(ServiceError, match="/merger/mode is 'BOTH'; expected one of MERGE"):
        process.reconfigure("/merger", mode="BOTH")
    np.testing.assert_allclose(answer(process), [REGULAR])
