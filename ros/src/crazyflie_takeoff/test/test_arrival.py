"""When a takeoff has succeeded, and takeoffs and landings with a given thrust."""

import pytest
from flight_words import thrusts
from takeoff_helpers import GRAVITY, SERVER, HoverNetwork


def departing(hover_z, **server):
    network = HoverNetwork({**SERVER, "hover/z": hover_z, **server})
    network.advance(0.5)
    return network, network.call("/takeoff")


def test_a_takeoff_has_succeeded_when_the_vehicle_is_there():
    """The controller needs longer than duration/hover."""
    network, answer = departing(4.5, **{"duration/hover": 1.0})
    network.advance_until(lambda: network.last("/in_flight_flight_status") == "flying")
    assert not answer.done()
    network.advance_until(answer.done)
    assert answer.exception() is None
    assert network.vehicle.z == pytest.approx(4.5, abs=0.31)


def test_a_vehicle_that_another_reference_has_is_not_waited_for():
    network, answer = departing(1.0)
    network.advance_until(lambda: network.last("/in_flight_flight_status") == "taking_off")
    controller = network.process("controller").node
    network.advance(2.0)
    controller._reference = (2.0, 0.0)
    network.advance_until(answer.done)
    assert answer.exception() is None
    assert network.last("/in_flight_flight_status") == "flying"
    assert "m away from the hover point" in network.process("server").logged("info")[-1]


def test_thrust_and_duration_of_a_fork():
    """Its ramp goes from the thrust of the takeoff to 9 m/s^2."""
    given = {"takeoff/thrust": 12.0, "duration/landing": 2.0, "landing/descent_speed": 0.0}
    network, answer = departing(1.0, **given)
    network.vehicle_node.vehicle.command = lambda thrust, command=network.vehicle.command: command(
        thrust * GRAVITY / 12.0
    )
    begin = network.time
    network.advance(0.02)
    assert thrusts(network, begin)[-1] == 12.0
    network.advance_until(answer.done)
    landing = network.time
    landed = network.call("/land")
    network.advance_until(landed.done)
    sent = [
        (time - landing, message.control.thrust)
        for time, message in network.on("/control/takeoff", landing)
    ]
    ramp = [(time, thrust) for time, thrust in sent if thrust > 0.0]
    assert ramp[0][1] == pytest.approx(12.0, abs=0.05)
    assert ramp[-1] == (pytest.approx(2.0, abs=0.03), pytest.approx(9.0, abs=0.05))
