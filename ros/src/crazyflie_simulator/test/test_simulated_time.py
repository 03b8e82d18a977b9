"""Simulated time, with a simulator as its source, on a fake process."""

import math

import pytest
from simulators import NODES, PARAMETERS, refusal, transforms

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_simulator.quadrotor_simulator_node import QuadrotorSimulatorNode
from crazyflie_simulator.simulator_node import NearHoverSimulatorNode
from crazyflie_utils.node import Node, Process
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.testing.fake_transport import FakeTransport


class ThrustProfile(Node):
    """Commands, every 50 ms of simulated time, a thrust that depends on time alone."""

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self._publisher = handle.publisher("/control/final", ControlStamped)
        handle.timer(0.05, self._on_timer)

    def _on_timer(self):
        t = self._handle.time()
        control = Control(0.1 * math.sin(t), 0.1 * math.cos(3.0 * t), 0.2, 10.5 + math.sin(t))
        self._publisher.publish(ControlStamped(control=control))


def clocked(node_class=NearHoverSimulatorNode, **changes):
    """Return a process in which a thrust profile flies a simulator that sets the clock.

    Only the machine's time is moved by hand.
    """
    process = FakeProcess(start=0.0)
    parameters = {**PARAMETERS, "clock/publish": True, **changes}
    assert process.launch(node_class(), "/simulator", parameters)
    assert process.launch(ThrustProfile(), "/thrust_profile")
    return process


@NODES
@pytest.mark.parametrize("time_step", [0.001, 0.01])
def test_two_runs_with_the_same_controls_are_the_same_to_the_bit(node_class, time_step):
    def fly():
        process = clocked(node_class, time_step=time_step, **{"mocap/position_noise": 1e-3})
        process.advance_machine(2.0)
        return transforms(process)

    first = fly()
    assert first == fly()
    assert first[-1].transform.translation.z > 0.3


def test_the_clock_s_rate_does_not_change_the_flight():
    def poses(**changes):
        process = clocked(QuadrotorSimulatorNode, **changes)
        process.advance_machine(2.0)
        return {transform.header.stamp: transform for transform in transforms(process)}

    fine, coarse = poses(time_step=0.001), poses(time_step=0.01)
    assert len(coarse) == 200
    assert all(fine[stamp] == transform for stamp, transform in coarse.items())


def test_every_tick_moves_the_clock_by_a_time_step():
    process = clocked()
    process.advance_machine(2.5)
    times = [message.clock.to_sec() for message in process.published("/clock")]
    assert times == pytest.approx([0.01 * k for k in range(1, 251)], abs=1e-9)
    assert process.clock.time() == pytest.approx(2.5)


def test_a_pose_is_out_before_its_time():
    # A node that wakes at a time finds the pose of that time.
    process = clocked()
    poses_at = {}
    process.clock.on_change(lambda now, _: poses_at.update({now: len(transforms(process))}))
    process.advance_machine(0.05)
    assert list(poses_at.values()) == [1, 2, 3, 4, 5]


@pytest.mark.parametrize(("factor", "count"), [(1.0, 10), (4.0, 40), (0.5, 5)])
def test_the_real_time_factor_is_how_often_the_clock_ticks(factor, count):
    process = clocked(**{"clock/real_time_factor": factor})
    process.advance_machine(0.1)
    assert len(process.published("/clock")) == count


def test_without_a_real_time_factor_the_clock_ticks_as_fast_as_the_machine_can():
    process = clocked(**{"clock/real_time_factor": 0})
    process.advance_machine(0.01)
    assert process.clock.time() > 0.1


def test_a_clock_needs_simulated_time():
    process = Process(FakeTransport({}), use_sim_time=False)
    text = refusal(process=process, **{"clock/publish": True})
    assert "/simulator/clock/publish" in text
    assert "/use_sim_time" in text


def test_lives_by_the_clock_of_another():
    process = clocked()
    parameters = {**PARAMETERS, "frames/robot": "other", "topics/control": "/other/control"}
    assert process.launch(QuadrotorSimulatorNode(), "/other", parameters)
    process.advance_machine(0.1)
    stamps = {}
    for transform in transforms(process):
        stamps.setdefault(transform.child_frame_id, []).append(transform.header.stamp)
    assert stamps["other"] == stamps["crazyflie"]
    assert len(process.published("/clock")) == 10
