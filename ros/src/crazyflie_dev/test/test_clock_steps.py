"""The wall clock of the machine is set, on the ground and in flight of the software example."""

import pytest
from std_srvs.srv import EmptyRequest

from crazyflie_dev.soak import Soak
from crazyflie_msgs.msg import FilterStatus, PositionVelocityStateStamped
from crazyflie_utils.tf.transforms import MAX_FUTURE_STAMP

#: Topics with stamped messages, one of which is under way when the clock is set; and who sends it.
SENDERS = {
    "/tf": "/simulator",
    "/state": "/state_estimator",
    "/ref": "/takeoff_server",
    "/control/lqr": "/lqr_controller",
    "/control/takeoff": "/takeoff_server",
}
STEPS = [sign * step for step in (0.05, 0.15, 1.0, 30.0, 3600.0, 86400.0) for sign in (-1, 1)]


@pytest.fixture
def run(monkeypatch):
    """Return a soak by wall-clock time, whose transforms may be as far ahead of now as then."""
    monkeypatch.setattr("crazyflie_utils.context.MAX_FUTURE_STAMP_SIMULATED", MAX_FUTURE_STAMP)
    run = Soak(seed=1, simulator_dt=0.01)
    run.graph.step_wall_clock(1.7e9)
    run.graph.advance(3.0)
    return run


def step_clock(graph, step):
    """Set the wall clock by ``step`` (s) while a message on each topic is under way."""
    under_way = []

    def hold(topic, message):
        under_way.append((topic, message))
        return []

    for topic in SENDERS:
        graph.faults[topic] = lambda message, topic=topic: hold(topic, message)
    graph.advance(0.015)
    graph.step_wall_clock(step)
    graph.faults.clear()
    for topic, message in under_way:
        graph.publish(topic, message, SENDERS[topic])
    assert under_way


def take_off(run):
    run.watch.may_fly = True
    run.watch.allow(1.0)
    takeoff = run.graph.call("/takeoff", EmptyRequest())
    run.graph.advance(10.0)
    assert takeoff.done() and takeoff.exception() is None


def move_to(graph, x):
    message = PositionVelocityStateStamped()
    message.header.stamp = graph.stamp()
    message.state.x, message.state.z = x, 1.0
    graph.publish("/ref", message)


@pytest.mark.parametrize("step", STEPS)
def test_a_flight_goes_on_when_the_clock_is_set(run, step):
    graph = run.graph
    take_off(run)
    move_to(graph, 1.0)
    graph.advance(0.6)
    states, thrusts = [], []
    graph.listen("/in_flight_filter_status", lambda message: states.append(message.state))
    graph.listen("/control/final", lambda message: thrusts.append(message.control.thrust))
    step_clock(graph, step)
    graph.advance(2.0)
    assert set(states) <= {FilterStatus.PASSING}
    # One velocity that is calculated from two clocks asks for 4 or for 16 m/s^2.
    assert 8.0 < min(thrusts) and max(thrusts) < 12.0
    # References that come now are followed, too.
    move_to(graph, -0.5)
    graph.advance(8.0)
    assert run.watch.state == "flying"
    assert run.watch.distance == pytest.approx(0.5, abs=0.1)
    assert run.watch.violations == []


@pytest.mark.parametrize("step", [-86400.0, -1.0, -0.15, 0.15, 1.0, 86400.0])
def test_a_vehicle_takes_off_after_the_clock_was_set_on_the_ground(run, step):
    step_clock(run.graph, step)
    run.graph.advance(0.5)
    take_off(run)
    assert run.watch.state == "flying"
    assert run.watch.violations == []
