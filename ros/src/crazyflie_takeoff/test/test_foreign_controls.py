"""Controls that are not to be obeyed, in whole flights: what else is published on their topics."""

import pytest
from flight_words import states, texts, thrusts, until_on_ground
from takeoff_helpers import GRAVITY, ControllerNode, HoverNetwork, control, feedback

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE
from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_utils.node import Node
from crazyflie_utils.refusal import ServiceError

COMMANDED, TAKEOFF = "/control/lqr", "/control/takeoff"


class RogueNode(Node):
    """Publishes one control again and again, or what ``law(z, z_dot)`` says."""

    def __init__(self, topic, thrust=20.0, period=0.01, law=None):
        super().__init__()
        self.is_silent = False
        self._topic, self._thrust, self._period, self._law = topic, thrust, period, law

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self._publisher = handle.publisher(self._topic, ControlStamped)
        handle.timer(self._period, self._on_timer)

    def _on_timer(self):
        if not self.is_silent:
            thrust = self._thrust if self._law is None else self._law()
            self._publisher.publish(control(thrust))


def climb_of(network, duration):
    """Advance the time; return the largest height of the vehicle, m."""
    top = network.vehicle.z
    for _ in range(round(duration / 0.05)):
        network.advance(0.05)
        top = max(top, network.vehicle.z)
    return top


@pytest.mark.parametrize("period", [0.01, pytest.param(0.1, marks=pytest.mark.long), 0.5])
@pytest.mark.parametrize("thrust", [20.0, 1e300, pytest.param(-1e300, marks=pytest.mark.long)])
def test_a_second_controller_in_flight_lands_the_vehicle(network, period, thrust):
    begun = network.time
    network.start("rogue", RogueNode(COMMANDED, thrust, period))
    assert climb_of(network, 12.0) < 1.5
    until_on_ground(network)
    assert max(thrusts(network, begun)) <= MAX_THRUST
    assert network.vehicle.touchdown_speed < 0.6
    words = "two nodes publish commanded controls, /controller and /rogue; expected one"
    assert any(words in message.data for _, message in network.on("/in_flight_status", begun))
    with pytest.raises(ServiceError, match="two nodes publish commanded controls"):
        network.call("/takeoff")
    network.kill("rogue")
    network.advance(6.0)
    network.take_off()


def test_one_controller_that_lifts_for_ever_is_limited_and_then_not_obeyed(network):
    begun = network.time
    network.kill("controller")
    network.start("rogue", RogueNode(COMMANDED, 1e300))
    top = climb_of(network, 2.5)
    until_on_ground(network)
    assert top < 8.5
    assert max(thrusts(network, begun)) <= MAX_THRUST
    told = texts(m for _, m in network.on("/in_flight_filter_status", begun))
    assert any("the controls climb faster than 3 m/s; the filter lands" in text for text in told)
    assert network.vehicle.touchdown_speed < 0.6


def test_no_vehicle_climbs_above_the_highest_place(network):
    network.kill("controller")
    vehicle = network.vehicle

    def law():
        return GRAVITY + 2.0 * (2.0 - vehicle.z_dot)

    network.start("rogue", RogueNode(COMMANDED, law=law))
    assert 9.0 < climb_of(network, 15.0) < 10.2
    network.advance_until(lambda: network.last("/in_flight_flight_status") == "on_ground", 60.0)
    told = texts(m for _, m in network.on("/in_flight_filter_status"))
    assert any("the controls climb beyond 10.00 m" in text for text in told)


def test_a_second_takeoff_server_in_flight_lands_the_vehicle(network):
    begun = network.time
    network.start("rogue", RogueNode(TAKEOFF))
    assert climb_of(network, 8.0) < 1.2
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 0.6
    network.advance(3.0)
    assert network.vehicle.z == 0.0
    told = texts(m for _, m in network.on("/in_flight_filter_status", begun))
    assert any("two nodes publish takeoff controls, /rogue and /server" in text for text in told)


def test_a_second_takeoff_server_on_the_ground_lifts_nothing():
    network = HoverNetwork()
    network.advance(1.0)
    rogue = network.start("rogue", RogueNode(TAKEOFF))
    assert climb_of(network, 3.0) == 0.0
    assert set(thrusts(network)) == {0.0}
    with pytest.raises(ServiceError, match="two nodes publish takeoff controls"):
        network.call("/takeoff")
    rogue.is_silent = True
    network.advance(6.0)
    network.take_off()


@pytest.mark.parametrize("thrust", [GRAVITY, 10.5, 20.0])
def test_a_landing_wins_over_who_keeps_the_vehicle_up(network, thrust):
    network.kill("controller")
    vehicle = network.vehicle

    def law():
        return thrust if thrust > GRAVITY else feedback((1.0, 0.0), vehicle.z, vehicle.z_dot)

    network.start("rogue", RogueNode(COMMANDED, law=law))
    network.advance(0.1)
    network.call("/land")
    assert climb_of(network, 2.0) < 2.2
    until_on_ground(network)
    assert vehicle.touchdown_speed < 0.6
    told = texts(m for _, m in network.on("/in_flight_filter_status"))
    assert any("the vehicle has not come down for 1.5 s of a landing" in text for text in told)


def test_a_controller_that_is_started_again_is_no_second_one(network):
    for _ in range(5):
        network.kill("controller")
        network.advance(0.3)
        network.start("controller", ControllerNode())
        network.advance(1.0)
    assert network.last("/in_flight_flight_status") == "flying"
    assert network.vehicle.z == pytest.approx(1.0, abs=0.02)


def test_another_controller_may_take_the_place_of_the_first(network):
    network.start("other", ControllerNode())
    network.process("filter").publish(COMMANDED, control(GRAVITY))
    network.kill("controller")
    network.advance(1.0)
    assert network.last("/in_flight_flight_status") == "flying"


def test_attitude_and_yaw_rate_are_limited(network):
    wild = ControlStamped(control=Control(roll=1e300, pitch=-3.0, yaw_dot=-1e9, thrust=GRAVITY))
    for topic, caller in ((TAKEOFF, "/server"), (COMMANDED, "/controller")):
        wild._connection_header = {"callerid": caller, "topic": topic}
        network.process("filter").publish(topic, wild)
        final = network.last_of("filter", "/control/final").control
        assert (final.roll, final.pitch, final.yaw_dot) == (MAX_TILT, -MAX_TILT, -MAX_YAW_RATE)


def test_a_flight_says_nothing_of_all_this(network):
    network.call("/land")
    until_on_ground(network)
    assert network.process("filter").logged("warn") == []
    assert states(network)[-1] == "on_ground"
