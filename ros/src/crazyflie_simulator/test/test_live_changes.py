"""Whatever live parameters change in flight, the vehicle stays where numbers are."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulators import command, launch, transforms

from crazyflie_simulator.quadrotor_simulator_node import (
    QuadrotorSimulatorNode,
    QuadrotorSimulatorParameters,
)
from crazyflie_utils.testing.random_input import live_changes


def numbers(transform):
    translation, rotation = transform.transform.translation, transform.transform.rotation
    return [getattr(translation, axis) for axis in "xyz"] + [
        getattr(rotation, axis) for axis in "xyzw"
    ]


@pytest.mark.filterwarnings("error")
@given(st.lists(live_changes(QuadrotorSimulatorParameters), min_size=1, max_size=4))
def test_any_live_change_leaves_the_vehicle_and_its_poses_finite(changes):
    process = launch(QuadrotorSimulatorNode, **{"init/z": 2.0})
    for change in [*changes, {"mocap/latency": 0.0, "mocap/dropout": 0.0}]:
        process.reconfigure("/simulator", **change)
        command(process, 9.81)
        process.advance(0.05)
    assert all(math.isfinite(number) for each in transforms(process) for number in numbers(each))
    assert process.logged("error") == []
    assert transforms(process)[-1].header.stamp == process.clock.stamp()
