"""A simulator whose poses have no subscriber makes those that are looked up, and the same ones."""

import pytest
from simulators import NODES, command, launch, transforms
from test_simulated_time import clocked

from crazyflie_model.units import GRAVITY
from crazyflie_simulator.simulator_node import IDLE_PERIOD, NearHoverSimulatorNode
from crazyflie_utils import NodeHandle, TransformError
from crazyflie_utils.node import Node

#: Time of a fake process for a tick of a clock at full speed (s).
TICK = 1e-4


class Looker(Node):
    """Looks the vehicle up every 30 ms."""

    def __init__(self):
        self.poses = []

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self._lookup = handle.listen_to_poses()
        handle.timer(0.03, self._look)

    def _look(self):
        try:
            self.poses.append((self._handle.time(), self._lookup("world", "crazyflie")))
        except TransformError:
            self.poses.append(None)


def hears(process, **topics):
    """Say whether another process subscribes to what a process publishes."""
    for topic, is_heard in topics.items():
        record = process.transport.publishers[f"/{topic}"]
        record.has_subscribers = lambda is_heard=is_heard: is_heard


def fly(node_class, tf, clock, **changes):
    """Return what is looked up in a flight of 1 s, and the process."""
    process = clocked(node_class, **{"time_step": 0.001, "clock/real_time_factor": 0, **changes})
    looker = Looker()
    assert process.launch(looker, "/looker")
    hears(process, tf=tf, clock=clock)
    while process.clock.time() < 0.9995:
        process.advance_machine(TICK)
    assert bool(process.published("/tf")) == tf
    assert bool(process.published("/clock")) == clock
    return looker.poses, process


@NODES
def test_with_its_own_clock_what_is_looked_up_is_the_same_to_the_bit(node_class):
    heard, _ = fly(node_class, tf=True, clock=True)
    assert heard[-1][1].position[2] > 0.05
    for clock in (True, False):
        poses, _ = fly(node_class, tf=False, clock=clock)
        assert poses == heard


def test_who_listens_to_the_clock_is_told_of_every_tick():
    for tf in (True, False):
        _, process = fly(NearHoverSimulatorNode, tf=tf, clock=True)
        ticks = [message.clock.to_nsec() for message in process.published("/clock")]
        assert ticks == [1_000_000 * k for k in range(1, 1001)]


def test_where_poses_have_no_subscriber_time_stops_only_where_something_happens():
    moments = []
    process = clocked(**{"time_step": 0.001, "clock/real_time_factor": 0})
    hears(process, tf=False, clock=True)
    process.clock.on_change(lambda time, _: moments.append(time))
    while process.clock.time() < 0.9995:
        process.advance_machine(TICK)
    assert len(moments) < 100


@pytest.mark.parametrize("error", ["position_noise", "latency"])
def test_errors_are_those_of_all_poses(error):
    heard, _ = fly(NearHoverSimulatorNode, tf=True, clock=False, **{f"mocap/{error}": 0.01})
    process = clocked(**{"time_step": 0.001, "clock/real_time_factor": 0, f"mocap/{error}": 0.01})
    looker = Looker()
    assert process.launch(looker, "/looker")
    hears(process, tf=False, clock=False)
    process.advance_machine(1000 * TICK)
    assert looker.poses == heard


@pytest.fixture
def real_time(monkeypatch):
    """Run a fake process in real time, for a simulator."""
    monkeypatch.setattr(NodeHandle, "uses_sim_time", property(lambda handle: False))


@pytest.mark.usefixtures("real_time")
def test_in_real_time_the_present_pose_is_looked_up():
    process = launch(time_step=0.001)
    looker = Looker()
    assert process.launch(looker, "/looker")
    hears(process, tf=False)
    command(process, thrust=GRAVITY + 1.0)
    process.advance(1.0)
    assert process.published("/tf") == []
    for time, pose in looker.poses:
        assert time - 0.0011 < pose.stamp * 1e-9 < time + 1e-6
        flown = pose.stamp * 1e-9 - 100.0
        assert pose.position[2] == pytest.approx(0.5 * flown**2, abs=1e-6)


@pytest.mark.usefixtures("real_time")
def test_in_real_time_who_begins_to_listen_hears_all_poses_from_then_on():
    process = launch(time_step=0.001)
    hears(process, tf=False)
    process.advance(1.0)
    hears(process, tf=True)
    process.advance(1.0)
    stamps = [each.header.stamp.to_sec() for each in transforms(process)]
    assert stamps[0] < 101.0 + IDLE_PERIOD + 0.0015
    first = round((stamps[0] - 100.0) * 1000)
    assert stamps == pytest.approx([100.0 + 0.001 * k for k in range(first, first + len(stamps))])
    assert stamps[-1] == pytest.approx(102.0, abs=0.0015)
    hears(process, tf=False)
    process.advance(1.0)
    assert len(transforms(process)) < len(stamps) + 10
