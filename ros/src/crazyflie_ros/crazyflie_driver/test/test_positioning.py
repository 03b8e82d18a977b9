"""A vehicle that is flown by its own estimate: what its decks say decides."""

import math
import time

import pytest
import rospy
from geometry_msgs.msg import PoseStamped

from crazyflie_driver.positioning import SYSTEMS, Positioning
from crazyflie_driver.srv import TakeoffRequest, UpdateParamsRequest
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.testing import virtual_vehicle

TAKEOFF = TakeoffRequest(height=0.5, duration=rospy.Duration(2))
#: Port, channel and data of the packet by which a radio restarts the firmware.
RESTART = (15, 3, b"\xfe\xf0\x01")
GOOD = {
    "flow": (300.0, 1e-3, 1e-3),
    "lighthouse": (3.0, 3.0, 3.0, 1e-6, 1e-6, 1e-6),
    "loco": (1e-4, 1e-4, 1e-4),
}


def changed(source, variable, value):
    values = dict(zip(SYSTEMS[source].variables, GOOD[source], strict=True))
    assert variable in values
    return tuple({**values, variable: value}.values())


@pytest.mark.parametrize("source", GOOD)
def test_nothing_is_wrong_with_a_good_state(source):
    positioning = Positioning(source)
    assert "has not come" in positioning.problem(0.0)
    positioning.update(10.0, GOOD[source])
    assert positioning.problem(10.1) == ""
    assert not positioning.is_lost(10.4)
    assert "has not come for 1.0 s" in positioning.problem(11.0)
    assert positioning.is_lost(11.0)


@pytest.mark.parametrize(
    ("source", "variable", "value", "words"),
    [
        ("flow", "range.zrange", 5000.0, "no ground within its reach (range.zrange is 5000 mm)"),
        ("flow", "range.zrange", 8190.0, "no ground within its reach"),
        ("flow", "kalman.varPY", 0.04, "velocity with a deviation of 0.20 m/s, expected at most"),
        ("flow", "kalman.varPX", math.nan, "velocity with a deviation of nan"),
        ("lighthouse", "lighthouse.bsReceive", 0.0, "receives no base station"),
        ("lighthouse", "lighthouse.bsGeoVal", 0.0, "no geometry of the base stations"),
        ("lighthouse", "lighthouse.bsCalVal", 4.0, "no calibration of the base stations"),
        ("lighthouse", "kalman.varX", 0.01, "position with a deviation of 0.10 m"),
        ("loco", "kalman.varZ", 1.0, "position with a deviation of 1.00 m"),
    ],
)
def test_problems_are_named_at_once_and_end_a_flight_once_they_last(source, variable, value, words):
    positioning = Positioning(source)
    positioning.update(10.0, GOOD[source])
    for now in (10.1, 10.2, 10.3, 10.4):
        positioning.update(now, changed(source, variable, value))
        assert words in positioning.problem(now)
        assert not positioning.is_lost(now)
    positioning.update(10.6, changed(source, variable, value))
    assert positioning.is_lost(10.6)
    positioning.update(10.7, GOOD[source])
    assert positioning.problem(10.7) == ""
    assert not positioning.is_lost(10.7)


def test_estimates_keep_the_time_at_which_they_were_made():
    """A vehicle's clock that began 50 s before, and a link that delays some by up to 80 ms."""
    positioning = Positioning("flow")
    times = []
    for k in range(600):
        sent = 3.0 + 0.01 * k
        delay = 0.08 if k % 7 == 0 else 0.002
        arrival = 50.0 + sent + delay
        times.append((sent, positioning.local_time(sent, arrival)))
    assert times[0][1] is None
    late = [(sent, local) for sent, local in times if local is not None]
    assert len(late) > 400
    for sent, local in late:
        assert local - sent == pytest.approx(50.002, abs=1e-3)
    # One that has come already is not published twice.
    assert positioning.local_time(sent, arrival + 0.01) is None


def add(server, uri, positioning):
    server.process.transport.parameters["/cf1/positioning"] = positioning
    server.add(uri)


@pytest.mark.parametrize(
    ("positioning", "deck", "words"),
    [
        ("lighthouse", "flow", "no Lighthouse deck .*bcLighthouse4.*it has .*bcFlow2"),
        ("loco", "none", "no Loco Positioning deck"),
        ("gps", "flow", "positioning is 'gps'; expected one of mocap, lighthouse, flow, loco"),
    ],
)
def test_a_deck_that_is_not_there_is_named(server, positioning, deck, words):
    with (
        virtual_vehicle(positioning=deck) as (_, uri),
        pytest.raises(ServiceError, match=words),
    ):
        add(server, uri, positioning)


def transforms(server):
    messages = server.process.transport.publishers["/tf"].messages
    return [each for message in messages for each in message.transforms]


def test_the_estimate_is_on_tf_and_ends_when_no_base_station_is_seen(server):
    with virtual_vehicle(positioning="lighthouse") as (virtual, uri):
        add(server, uri, "lighthouse")
        pass_time(server, lambda: len(transforms(server)) > 20)
        first = transforms(server)[0]
        assert (first.header.frame_id, first.child_frame_id) == ("world", "cf1/estimate")
        poses = server.process.published("/cf1/pose")
        assert poses[0].header.stamp == first.header.stamp
        assert server.process.published("/cf1/positioning")[-1].data == ""
        # An external pose may be this very estimate.
        server.process.publish("/cf1/external_pose", PoseStamped())
        assert "ignoring external_pose" in server.process.logged("warn")[-1]
        virtual.switches.occluded = 3
        texts = server.process.published("/cf1/positioning")
        pass_time(server, lambda: "receives no base station" in texts[-1].data)
        with pytest.raises(ServiceError, match="no takeoff.*receives no base station"):
            server.call("/cf1/takeoff", TAKEOFF)
        positioning = server.node._vehicles[uri].log.positioning
        pass_time(server, lambda: positioning.is_lost(server.process.clock.time()))
        before, count = len(transforms(server)), len(poses)
        pass_time(server, lambda: len(poses) > count + 20)
        assert len(transforms(server)) == before


def distances(server, begin=0):
    """Return the distances of the transforms, from a number on, to the true position (2, 1), m."""
    places = [each.transform.translation for each in transforms(server)[begin:]]
    return [math.hypot(place.x - 2.0, place.y - 1.0) for place in places]


def test_a_flow_vehicle_whose_battery_is_changed_is_at_its_initial_position_again(server):
    values = {"initialX": 2.0, "initialY": 1.0, "resetEstimation": 1}
    for name, value in values.items():
        server.process.transport.parameters[f"/cf1/kalman/{name}"] = value
    with virtual_vehicle(positioning="flow", init_x=2.0, init_y=1.0) as (virtual, uri):
        add(server, uri, "flow")
        update = UpdateParamsRequest([f"kalman/{name}" for name in values])
        server.call("/cf1/update_params", update)
        pass_time(server, lambda: distances(server)[-1:] and distances(server)[-1] < 0.1)
        before, begin = virtual.vehicle.board, len(transforms(server))
        crazyflie = server.node._vehicles[uri].crazyflie
        crazyflie.send_packet(*RESTART)
        wait_until(lambda: virtual.vehicle.board is not before, "the restart")
        pass_time(server, lambda: crazyflie.connection_count == 2)
        count = len(transforms(server))
        pass_time(server, lambda: len(transforms(server)) > count + 20)
        # Not one of them is where the estimate has begun.
        assert max(distances(server, begin)) < 0.1
        assert server.process.published("/cf1/positioning")[-1].data == ""


def test_an_estimate_that_has_begun_elsewhere_is_not_used_until_it_is_reset():
    positioning = Positioning("flow")
    positioning.update(10.0, GOOD["flow"])
    assert positioning.is_usable(10.0)
    positioning.suspend("elsewhere")
    positioning.update(10.1, GOOD["flow"])
    assert positioning.problem(10.1) == "elsewhere"
    assert not positioning.is_usable(10.1)
    # A flight goes on: what is wrong is not the deck.
    assert not positioning.is_lost(10.1)
    positioning.resume(10.3)
    assert positioning.problem(10.2) == "its estimate has been reset"
    assert not positioning.is_usable(10.2)
    positioning.update(10.3, GOOD["flow"])
    assert positioning.problem(10.3) == ""
    assert positioning.is_usable(10.3)


def test_a_flow_deck_that_sees_no_ground_is_a_problem(server, monkeypatch):
    """As above a hole, or a floor that swallows its light; the log has the raw reading."""
    with virtual_vehicle(positioning="flow") as (virtual, uri):
        add(server, uri, "flow")
        texts = server.process.published("/cf1/positioning")
        pass_time(server, lambda: texts and texts[-1].data == "")
        ranging = virtual.vehicle.board.firmware.ranging
        monkeypatch.setattr(ranging, "_distance", lambda direction: 6.0)
        pass_time(server, lambda: "range.zrange is 6000 mm" in texts[-1].data)
        with pytest.raises(ServiceError, match="no takeoff.*no ground within its reach"):
            server.call("/cf1/takeoff", TAKEOFF)


def pass_time(server, condition):
    """Make the driver's clock follow the machine's until a condition holds."""
    ahead = server.process.clock.time() - time.monotonic()

    def is_met():
        server.process.advance(time.monotonic() + ahead - server.process.clock.time())
        return condition()

    wait_until(is_met)
