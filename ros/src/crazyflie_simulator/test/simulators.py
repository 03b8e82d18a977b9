"""Simulators on fake processes, for the tests of the nodes."""

import pytest

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_simulator.quadrotor_simulator_node import QuadrotorSimulatorNode
from crazyflie_simulator.simulator_node import (
    NearHoverSimulatorCoupled7DNode,
    NearHoverSimulatorNode,
)
from crazyflie_utils.testing import FakeProcess

PARAMETERS = {
    "time_step": 0.01,
    "init/x": 1,
    "init/y": 2.0,
    "init/z": 0.0,
    "frames/fixed": "world",
    "frames/robot": "crazyflie",
    "topics/control": "/control/final",
}

NODES = pytest.mark.parametrize(
    "node_class", [NearHoverSimulatorNode, NearHoverSimulatorCoupled7DNode, QuadrotorSimulatorNode]
)


def launch(node_class=NearHoverSimulatorNode, **changes):
    """Return a process with a simulator in it."""
    process = FakeProcess()
    assert process.launch(node_class(), "/simulator", {**PARAMETERS, **changes})
    return process


def refusal(node_class=NearHoverSimulatorNode, process=None, **changes):
    """Return what is logged when a simulator refuses to start."""
    process = process or FakeProcess()
    for key, value in {**PARAMETERS, **changes}.items():
        if value is not None:
            process.transport.parameters[f"/simulator/{key}"] = value
    assert not node_class().initialize(process.handle("/simulator"))
    (record,) = process.transport.log_records
    assert record[0] == "error"
    return record[1]


def command(process, thrust, roll=0.0, pitch=0.0, yaw_dot=0.0):
    """Send a control from outside."""
    message = ControlStamped(control=Control(roll, pitch, yaw_dot, thrust))
    process.publish("/control/final", message)


def transforms(process):
    """Return all transforms that were broadcast."""
    return [transform for message in process.published("/tf") for transform in message.transforms]


def heights(process):
    """Return the height, m, in each of them."""
    return [transform.transform.translation.z for transform in transforms(process)]
