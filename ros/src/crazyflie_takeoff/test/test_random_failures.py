"""Takeoffs and landings of vehicles of any weight in which one thing fails at a random moment."""

from operator import itemgetter

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from std_msgs.msg import Float64
from takeoff_helpers import GRAVITY, SERVER, ControllerNode, HoverNetwork, PointMass, control

from crazyflie_msgs.msg import FlightStatus

FLIGHT = 14.0  #: Duration of a flight (s).
#: What fails, and for how long it does (s).
FAILURES = st.one_of(
    st.tuples(st.just("camera"), st.sampled_from([0.1, 0.3, 1.0, 3.0, 60.0])),
    st.tuples(st.just("server"), st.sampled_from([0.05, 0.3, 1.0, 60.0])),
    st.tuples(st.just("controller"), st.sampled_from([0.05, 0.3, 1.0, 60.0])),
    st.tuples(st.just("filter"), st.just(0.05)),  # Nothing flies the vehicle meanwhile.
)


class Vehicle(PointMass):
    """A vehicle that hovers at a fraction of the assumed thrust, which its motors follow late."""

    LAG = 0.065

    def __init__(self, hover):
        super().__init__()
        self._hover, self._motors = hover, 0.0

    def _step(self):
        sent = self.thrust
        if sent is not None:
            self._motors += self.STEP / self.LAG * (sent / self._hover - self._motors)
            self.thrust = self._motors
        super()._step()
        self.thrust = sent


class Controller(ControllerNode):
    """One that begins with the measured thrust of hover, as the LQR does."""

    def register_callbacks(self, handle):
        super().register_callbacks(handle)
        publish, self._hover = self._control.publish, GRAVITY
        self._control.publish = lambda message: publish(
            control(min(max(message.control.thrust + self._hover - GRAVITY, 4.0), 16.0))
        )
        handle.subscribe("/in_flight_hover_thrust", Float64, self._on_hover_thrust)
        handle.subscribe("/in_flight_flight_status", FlightStatus, self._on_flight_status)

    def _on_hover_thrust(self, message):
        self._hover = message.data

    def _on_flight_status(self, message):
        if message.state == FlightStatus.ON_GROUND:
            self._hover = GRAVITY


def end(network, name):
    """End what is to fail."""
    if name == "camera":
        network.vehicle_node.sees = False
    else:
        network.kill(name)


def start(network, name):
    """Start what has failed again."""
    if name == "camera":
        network.vehicle_node.sees = True
    elif name == "controller":
        network.start(name, Controller())
    else:
        getattr(network, f"start_{name}")()


def fly(hover, height, lands, failures):
    """Fly a takeoff, and a landing; return the highest z above the begin or the hover point (m).

    ``failures`` are what fails, when, and for how long (s). Return the speed of the touchdown, too.
    """
    network = HoverNetwork({**SERVER, "hover/z": height})
    network.vehicle = network.vehicle_node.vehicle = Vehicle(hover)
    network.kill("controller")
    network.start("controller", Controller())
    network.advance(0.5)
    answer = network.call("/takeoff")
    if lands:
        network.advance_until(answer.done)
        network.call("/land")
    begin = highest = network.vehicle.z
    events = [(moment, end, name) for name, moment, _ in failures]
    events += [(moment + duration, start, name) for name, moment, duration in failures]
    events, now = sorted(events, key=itemgetter(0)), 0.0
    while now < FLIGHT:
        while events and events[0][0] <= now:
            _, act, name = events.pop(0)
            act(network, name)
        step = min(0.01, events[0][0] - now) if events else 0.01
        network.advance(step)
        now, highest = now + step, max(highest, network.vehicle.z)
    return highest - max(begin, height), network.vehicle.touchdown_speed


@pytest.mark.parametrize("lands", [False, True])
@given(st.floats(0.65, 1.3), st.sampled_from([0.3, 1.0]), st.floats(0.2, 4.0), FAILURES)
@example(0.75, 0.3, 0.21875, ("server", 1.0))  # It has not said the measured thrust of hover yet.
@example(0.75, 0.3, 0.203, ("camera", 1.0))  # It is not faster than `LIFT_OFF_SPEED` yet.
@example(1.0, 1.0, 1.625, ("filter", 0.05))  # The last control is the first of the climb.
def test_no_single_failure_lifts_a_vehicle_or_drops_it(lands, hover, height, moment, failure):
    name, duration = failure
    rise, touchdown_speed = fly(hover, height, lands, [(name, moment, duration)])
    assert rise < 0.75
    assert touchdown_speed < 2.4  # A fall from 0.3 m.


def test_a_server_that_is_restarted_in_the_fall_after_a_lost_liftoff_lifts_nothing():
    """Its ramp begins at g, and the vehicle hovers at 0.65 of that: it rose to 0.87 m, and fell."""
    rise, touchdown_speed = fly(0.65, 0.6, False, [("camera", 0.11, 1.0), ("server", 1.27, 0.3)])
    assert rise < 0.0
    assert touchdown_speed < 2.0


@pytest.mark.parametrize(
    ("hover", "failures"),
    [
        (0.65, [("camera", 0.113, 60.0), ("server", 0.692, 0.05)]),
        (0.75, [("server", 0.096, 1.0), ("camera", 1.435, 60.0)]),
    ],
)
def test_a_vehicle_of_which_too_little_was_seen_to_know_its_weight_sinks(hover, failures):
    """The filter hovered with 1.25, or 1.06, times the thrust of hover: it rose to 44 m, or 4.5 m.

    It was not seen for longer than 0.2 s, or for 0.9 s.
    """
    rise, touchdown_speed = fly(hover, 0.6, False, failures)
    assert rise < 0.0
    assert touchdown_speed < 2.0
