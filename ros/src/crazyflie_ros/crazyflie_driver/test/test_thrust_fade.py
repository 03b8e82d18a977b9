"""Level setpoints after a stream of thrust that has stopped in flight."""

import struct

import pytest
from geometry_msgs.msg import Twist, Vector3
from safety_helpers import FLYING, LAND, READY, is_, thrust, wait_for_words
from std_msgs.msg import Empty
from std_srvs.srv import EmptyRequest

from crazyflie_driver.msg import crtpPacket
from crazyflie_driver.srv import sendPacketRequest
from crazyflie_driver.thrust_fade import FADE_BEGIN, FADE_END, FADE_TIME, ThrustFade
from crazyflie_utils.testing.peer import wait_until

HOVER = 40000.0


def test_the_mean_of_a_second_fades_after_half_a_second():
    fade = ThrustFade()
    assert fade.thrust(0.0) is None
    fade.command(0.0, 60000.0)
    for step in range(100):
        fade.command(2.0 + 0.01 * step, HOVER * (1.1 if step % 2 else 0.9))
    end = 2.0 + 0.99
    assert fade.thrust(end + FADE_BEGIN - 0.01) is None
    assert fade.thrust(end + FADE_BEGIN + 0.001) == pytest.approx(HOVER, rel=0.001)
    middle = fade.thrust(end + FADE_BEGIN + 0.5 * FADE_TIME)
    assert middle == pytest.approx(0.5 * (1.0 + FADE_END) * HOVER)
    last = fade.thrust(end + FADE_BEGIN + FADE_TIME - 1e-6)
    assert last == pytest.approx(FADE_END * HOVER, rel=0.001)
    assert fade.thrust(end + FADE_BEGIN + FADE_TIME + 0.01) is None


def deliver(server, vehicle):
    """Wait until the vehicle has received what has been sent: only the latest setpoint waits."""
    link = server.node._vehicles[vehicle.uri].crazyflie.link()
    wait_until(lambda: not link._transmission._streams, "the setpoint to be sent")
    # Behind it.
    count = len(vehicle.packets(10, 0))
    packet = crtpPacket(size=1, header=10 << 4, data=[0] * 30)
    server.call("/cf1/send_packet", sendPacketRequest(packet))
    vehicle.wait_for_packets(10, 0, count + 1)


@pytest.fixture
def flown(server, vehicle):
    """Return a server and a vehicle that flies on a tilted thrust."""
    is_(vehicle, FLYING)
    wait_for_words(server, "flying")
    server.process.publish("/cf1/cmd_vel", Twist(Vector3(10, 5, HOVER), Vector3(0, 0, 30)))
    deliver(server, vehicle)
    vehicle.received.clear()
    return server, vehicle


def received(server, vehicle, duration):
    """Let time pass; return the attitude setpoints that came: roll, pitch, yaw rate, thrust."""
    for _ in range(round(duration / 0.1)):
        server.process.advance(0.1)
        deliver(server, vehicle)
    return [struct.unpack("<fffH", packet) for packet in vehicle.packets(3, 0)]


def test_a_stream_that_stops_in_flight_is_followed_by_level_setpoints(flown):
    server, vehicle = flown
    assert received(server, vehicle, 0.4) == []
    setpoints = received(server, vehicle, 3.0)
    assert 13 <= len(setpoints) <= 16
    assert all(each[:3] == pytest.approx((0.0, 0.0, 0.0)) for each in setpoints)
    thrusts = [each[3] for each in setpoints]
    assert thrusts == sorted(thrusts, reverse=True)
    assert HOVER >= thrusts[0] > 0.98 * HOVER
    assert thrusts[-1] == pytest.approx(FADE_END * HOVER, rel=0.01)
    warnings = [text for text in server.process.logged("warn") if "has stopped in flight" in text]
    assert len(warnings) == 1


def test_a_stream_that_goes_on_ends_the_fade(flown):
    server, vehicle = flown
    assert received(server, vehicle, 1.0)
    vehicle.received.clear()
    for _ in range(20):
        thrust(server, HOVER)
        received(server, vehicle, 0.1)
    sent = received(server, vehicle, 0.4)
    assert {each[3] for each in sent} == {HOVER}


def on_the_ground(server, vehicle):
    is_(vehicle, READY)
    wait_for_words(server, "ready")


def emergency(server, vehicle):
    server.call("/cf1/emergency", EmptyRequest())


@pytest.mark.parametrize(
    "end",
    [
        on_the_ground,
        emergency,
        lambda server, _: server.call("/cf1/land", LAND),
        lambda server, _: server.process.publish("/cf1/cmd_stop", Empty()),
        lambda server, _: server.process.publish("/cf1/cmd_vel", Twist()),
    ],
    ids=["ground", "emergency", "land", "cmd_stop", "zero thrust"],
)
@pytest.mark.parametrize("elapsed", [0.0, 1.0])
def test_nothing_follows_a_stream_that_was_ended(flown, end, elapsed):
    server, vehicle = flown
    received(server, vehicle, elapsed)
    end(server, vehicle)
    vehicle.received.clear()
    setpoints = received(server, vehicle, 2.5)
    assert [each for each in setpoints if each[3] > 0] == []


def test_a_link_that_is_back_goes_on_where_the_fade_would_be(flown):
    server, vehicle = flown
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    vehicle.is_frozen = False
    wait_for_words(server, "flying")
    vehicle.received.clear()
    assert [each for each in received(server, vehicle, 2.5) if each[3] >= HOVER] == []
