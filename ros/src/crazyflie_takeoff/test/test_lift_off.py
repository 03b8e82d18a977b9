"""A takeoff of vehicles that hover at less, or more, thrust than assumed."""

import pytest
from flight_words import states, thrusts
from takeoff_helpers import BARE, GRAVITY, SERVER, HoverNetwork

from crazyflie_takeoff.hover_thrust import LEAST_HOVER, MOST_HOVER
from crazyflie_takeoff.lift_off import CLIMB_SPEED, LIFT_OFF_THRUST, LiftOff


def scaled(hover, server=SERVER):
    """Return a network with a vehicle that hovers at a fraction of the assumed thrust."""
    network = HoverNetwork(server)
    command = network.vehicle.command
    network.vehicle.command = lambda thrust: command(thrust / hover)
    network.advance(0.5)
    return network


def take_off(network, duration):
    """Take off; return the greatest height and speed until then (m, m/s)."""
    network.call("/takeoff")
    highest = fastest = 0.0
    for _ in range(round(duration / 0.01)):
        network.advance(0.01)
        highest = max(highest, network.vehicle.z)
        fastest = max(fastest, network.vehicle.z_dot)
    return highest, fastest


def measured(network):
    return [message.data for _, message in network.on("/in_flight_hover_thrust")]


@pytest.mark.parametrize("hover", [0.65, 0.75, 0.86, 0.95])
def test_the_open_loop_ends_when_the_vehicle_has_lifted_off(hover):
    network = scaled(hover, {**SERVER, "hover/z": 0.3})
    highest, fastest = take_off(network, 1.5)
    assert highest < 0.45
    assert fastest < 0.7
    assert states(network)[-1] == "taking_off"
    assert network.on("/ref")[0][0] == pytest.approx(network.time - 0.5, abs=0.03)
    assert measured(network)[-1] == pytest.approx(hover * GRAVITY, rel=0.06)
    # Until the controller is selected, it is repeated.
    begin = network.on("/ref")[0][0]
    repeated = thrusts(network, begin + 0.02)
    assert len(repeated) > 40
    assert repeated == pytest.approx([measured(network)[-1]] * len(repeated), abs=0.01)


@pytest.mark.parametrize("hover", [1.0, 1.1, 1.3])
def test_an_open_loop_without_a_liftoff_is_as_long_as_it_is_said_to_be(hover):
    network = scaled(hover)
    begin = network.time
    take_off(network, 1.3)
    sent = [m.control.thrust for t, m in network.on("/control/takeoff", begin) if t < begin + 0.98]
    assert set(sent[1:]) == {LIFT_OFF_THRUST}
    assert measured(network) == []


def test_a_hover_point_that_is_near_ends_the_open_loop():
    network = scaled(0.97, {**SERVER, "hover/z": 0.05})
    assert take_off(network, 1.5)[0] < 0.15


@pytest.mark.parametrize("hover", [0.65, 1.0, 1.3])
def test_the_thrust_of_hover_is_that_with_which_the_vehicle_does_not_accelerate(hover):
    lift, speed = LiftOff(), 0.2
    for _ in range(300):
        lift.climb(1.0, speed)
        speed += 0.01 * (lift.thrust / hover - GRAVITY)
        lift.measure(0.01, speed)
    assert lift.hover == pytest.approx(hover * GRAVITY, rel=0.01)
    assert speed == pytest.approx(CLIMB_SPEED, abs=0.02)


def test_no_measurement_leads_beyond_the_range():
    lift = LiftOff()
    for speed in (0.2, 5.0, 50.0, -50.0, None, 3.0):
        lift.measure(0.01, speed)
        assert LEAST_HOVER <= lift.hover <= MOST_HOVER


@pytest.mark.parametrize("hover", [0.65, 0.8])
def test_a_landing_lifts_no_vehicle_that_hovers_at_less(hover):
    """Its ramp began at g: a vehicle that hovers at 0.65 g leapt to 1.1 m from the ground."""
    network = scaled(hover)
    answer = network.call("/takeoff")
    network.advance_until(answer.done)
    landed = network.call("/land")
    network.advance_until(lambda: states(network)[-1] == "landing")
    highest = 0.0
    while not landed.done():
        network.advance(0.01)
        highest = max(highest, network.vehicle.z)
    assert highest < 0.1


@pytest.mark.parametrize("hover", [0.65, 0.8, 1.0])
@pytest.mark.parametrize("camera", [True, False])
def test_a_vehicle_that_is_lost_early_in_its_climb_is_kept_by_its_own_thrust_of_hover(
    hover, camera
):
    """Of a vehicle that hovers at less, the filter believed g: it climbed without a control."""
    network = scaled(hover)
    network.call("/takeoff")
    network.advance_until(lambda: network.process("filter").node._memory.passed is not None)
    network.advance(0.1)
    network.vehicle_node.sees = camera
    network.kill("controller")
    begin = highest = network.vehicle.z
    while network.last_of("filter", "/control/final").control.thrust > 0.0:
        network.advance(0.01)
        highest = max(highest, network.vehicle.z)
    assert highest < begin + 0.3


@pytest.mark.parametrize(("hover", "height"), [(0.65, 2.2), (0.8, 1.7), (1.0, 1.05)])
def test_the_filter_limits_the_climb_of_a_server_that_sees_nothing(hover, height):
    """As that of C++: its vehicle rose to 9.3 m, or 4.0 m."""
    highest, _ = take_off(scaled(hover, BARE), 8.0)
    assert highest < height


@pytest.mark.parametrize("hover", [0.65, 0.8])
@pytest.mark.parametrize("moment", [0.2, 0.5])
def test_a_landing_in_the_liftoff_lifts_no_vehicle_that_hovers_at_less(hover, moment):
    """Its ramp began at g: the vehicle rose to 1.3 m, and fell from there."""
    network = scaled(hover)
    network.call("/takeoff")
    network.advance(moment)
    begin = highest = network.vehicle.z
    network.call("/land")
    while states(network)[-1] != "on_ground":
        network.advance(0.01)
        highest = max(highest, network.vehicle.z)
    assert highest < begin + 0.2
    assert network.vehicle.touchdown_speed < 1.3


@pytest.mark.parametrize("hover", [0.65, 0.8])
@pytest.mark.parametrize("moment", [0.05, 0.15])
def test_a_server_that_is_restarted_before_a_vehicle_has_lifted_off_stops_the_motors(hover, moment):
    """It ramped the thrust down from g: the vehicle rose to 0.7 m, and fell."""
    network = scaled(hover)
    network.call("/takeoff")
    network.advance(moment)
    network.kill("server")
    network.advance(0.02)
    network.start_server()
    highest = 0.0
    while states(network)[-1] != "on_ground":
        network.advance(0.01)
        highest = max(highest, network.vehicle.z)
    assert highest < 0.2


@pytest.mark.parametrize("hover", [0.65, 0.8])
@pytest.mark.parametrize("moment", [1.0, 4.0])
def test_a_server_that_is_restarted_lifts_no_vehicle_that_hovers_at_less(hover, moment):
    """It does not know the thrust of hover: its ramp began at g, and the vehicle leapt to 1.1 m."""
    network = scaled(hover)
    network.call("/takeoff")
    network.advance(moment)
    network.kill("server")
    network.start_server()
    network.advance(0.5)
    if states(network)[-1] == "flying":
        network.call("/land")
    network.advance_until(lambda: states(network)[-1] == "landing")
    highest = 0.0
    while states(network)[-1] != "on_ground":
        network.advance(0.01)
        highest = max(highest, network.vehicle.z)
    assert highest < 0.1


@pytest.mark.parametrize("hover", [0.65, 0.8])
@pytest.mark.parametrize("moment", [0.2, 0.4, 0.8])
def test_a_server_that_dies_in_the_liftoff_leaves_no_thrust_that_lifts(hover, moment):
    """The filter believed in g until the controller flew: the vehicle rose to 1.65 m."""
    network = scaled(hover)
    network.call("/takeoff")
    network.advance(moment)
    begin = highest = network.vehicle.z
    network.kill("server")
    for _ in range(500):
        network.advance(0.01)
        highest = max(highest, network.vehicle.z)
    assert highest < begin + 0.75


@pytest.mark.parametrize("hover", [0.65, 0.8, 1.0])
@pytest.mark.parametrize("moment", [0.02, 0.11, 0.2, 0.8])
def test_nothing_lifts_a_vehicle_that_is_not_seen_any_more(hover, moment):
    """The open loop went on: a vehicle that hovers at 0.65 of the assumed thrust rose to 4.2 m."""
    network = scaled(hover)
    answer = network.call("/takeoff")
    network.advance(moment)
    network.vehicle_node.sees = False
    begin = highest = network.vehicle.z
    while not answer.done():
        network.advance(0.01)
        highest = max(highest, network.vehicle.z)
    assert highest < begin + 0.45
    assert "the state on /state was lost in the liftoff" in str(answer.exception())
    assert states(network)[-1] == "landing"
    network.advance_until(lambda: states(network)[-1] == "on_ground")
    network.advance(1.0)
    assert network.vehicle.touchdown_speed < 1.6


@pytest.mark.parametrize("moment", [0.1, 0.3])
@pytest.mark.parametrize("hover", [0.7, 0.9, 1.0])
def test_a_liftoff_goes_on_after_a_short_time_without_a_state(hover, moment):
    network = scaled(hover)
    answer = network.call("/takeoff")
    network.advance(moment)
    network.vehicle_node.sees = False
    network.advance(0.4)
    network.vehicle_node.sees = True
    network.advance_until(answer.done)
    assert answer.exception() is None
    # One that has come down meanwhile has less thrust than it needs.
    assert all(thrust < 1.06 * hover * GRAVITY for thrust in measured(network)[-1:])


def test_a_vehicle_of_the_assumed_weight_is_pushed_on_through_a_short_time_without_a_state():
    network = scaled(1.0)
    network.call("/takeoff")
    network.advance(0.3)
    network.vehicle_node.sees = False
    network.advance(0.4)
    assert set(thrusts(network, network.time - 0.65)) == {LIFT_OFF_THRUST}
