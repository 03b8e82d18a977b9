"""Reports on a stream, in every state."""

import pytest

from mocap_optitrack.bodies import RIGID_BODIES
from mocap_optitrack.frame_times import FrameOrder
from mocap_optitrack.frames import SeenBody
from mocap_optitrack.health import ERROR, OK, WARN, Health

BODIES = RIGID_BODIES({"1": {"pose": "one"}, "cf7": {"pose": "seven"}})
ONE, SEVEN = BODIES


@pytest.fixture
def health():
    """Return the health of a connected stream at time 0."""
    health = Health(BODIES, stale_after=0.2, now=0.0)
    health.connected("a server")
    return health


def stream(health, begin, end, *tracked, lost=(), latency=0.005):
    """Process frames at 100 Hz, in which bodies are tracked or not."""
    for k in range(round(100 * begin), round(100 * end)):
        health.frame(0.01 * k, latency)
        for body in tracked:
            health.body(body, 0.01 * k, True)
        for body in lost:
            health.body(body, 0.01 * k, False)


def test_before_a_connection():
    stream_status, *bodies = Health(BODIES, 0.2, 0.0).report(1.0)
    assert stream_status[:3] == ("stream", ERROR, "not connected so far")
    assert [status[:3] for status in bodies] == [
        ("rigid body 1", ERROR, "no frames"),
        ("rigid body cf7", ERROR, "no frames"),
    ]


def test_a_good_stream(health):
    stream(health, 0.0, 2.0, ONE, SEVEN)
    health.frame(2.0, 0.025)
    stream_status, one, seven = health.report(2.0)
    assert stream_status.level == OK
    assert stream_status.message == "100.5 frames per second, 5.1 ms old"
    assert stream_status.values == {
        "server": "a server",
        "rate (Hz)": "100.5",
        "longest gap (ms)": "10.0",
        "stale frames": "0",
        "repeated frames": "0",
        "frames of another clock": "0",
        "latency, mean (ms)": "5.1",
        "latency, maximum (ms)": "25.0",
    }
    assert one[1:] == (
        OK,
        "tracked",
        {"frames": "200", "tracked": "200", "last seen (s ago)": "0.01"},
    )
    assert seven.level == OK


def test_every_report_is_about_the_time_since_the_last_one(health):
    stream(health, 0.0, 1.0, ONE)
    health.report(1.0)
    stream(health, 1.0, 1.5, ONE)
    stream_status, one, _ = health.report(2.0)
    assert stream_status.values["rate (Hz)"] == "50.0"
    assert one.values["frames"] == "50"


def test_connected_but_without_frames(health):
    assert health.report(1.0)[0][1:3] == (ERROR, "no frames")


def test_a_connection_that_ended(health):
    stream(health, 0.0, 1.0, ONE)
    health.disconnected("the cable is out")
    stream_status, one, _ = health.report(1.0)
    assert stream_status[1:3] == (ERROR, "the cable is out")
    assert stream_status.values["server"] == "none"
    assert one[1:3] == (ERROR, "no frames")


def test_a_connection_that_is_made_again_between_two_reports(health):
    stream(health, 0.0, 0.5, ONE)
    health.disconnected("the cable is out")
    health.connected("a server")
    stream_status, one, _ = health.report(1.0)
    assert stream_status[1:3] == one[1:3] == (ERROR, "no frames")


def test_a_connection_that_is_silent(health):
    stream(health, 0.0, 1.0, ONE)
    health.report(1.0)
    health.silent("no frames for 1 s; is it live?")
    assert health.report(2.0)[0][1:3] == (ERROR, "no frames for 1 s; is it live?")
    stream(health, 2.5, 3.0, ONE)
    assert health.report(3.0)[0].message == "gaps of up to 1510.0 ms"
    stream(health, 3.0, 4.0, ONE)
    assert health.report(4.0)[0].level == OK
    assert health.report(5.0)[0].message == "no frames"


def test_while_the_clock_is_learned(health):
    health.count(FrameOrder.LEARNING)
    assert health.report(1.0)[0][1:3] == (WARN, "learning the server's clock")


def test_stale_frames_only(health):
    health.count(FrameOrder.STALE)
    stream_status = health.report(1.0)[0]
    assert stream_status.level == ERROR
    assert "all frames are stale" in stream_status.message
    assert stream_status.values["stale frames"] == "1"


def test_a_clock_that_jumps_once_is_no_fault_but_again_and_again_is(health):
    stream(health, 0.0, 1.0, ONE)
    health.count(FrameOrder.RESTART)
    assert health.report(1.0)[0].level == OK
    stream(health, 1.0, 2.0, ONE)
    health.count(FrameOrder.RESTART)
    health.count(FrameOrder.RESTART)
    level, message = health.report(2.0)[0][1:3]
    assert level == ERROR
    assert "two servers" in message


@pytest.mark.parametrize(("foreign", "level"), [(1, OK), (2, WARN), (101, ERROR)])
def test_frames_of_two_servers(health, foreign, level):
    stream(health, 0.0, 1.0, ONE)
    for _ in range(foreign):
        health.count(FrameOrder.FOREIGN)
    assert health.report(1.0)[0].level == level


def test_gaps(health):
    stream(health, 0.0, 0.5, ONE)
    stream(health, 0.8, 1.0, ONE)
    assert health.report(1.0)[0][1:3] == (WARN, "gaps of up to 310.0 ms")


def test_a_gap_that_lasts(health):
    stream(health, 0.0, 0.5, ONE)
    assert health.report(1.0)[0][1:3] == (WARN, "gaps of up to 510.0 ms")


def test_a_body_that_is_lost_now_and_then(health):
    stream(health, 0.0, 0.25, ONE)
    stream(health, 0.25, 0.3, lost=[ONE])
    stream(health, 0.3, 1.0, ONE)
    assert health.report(1.0)[1][1:3] == (WARN, "tracked in 95 of 100 frames")


def test_a_body_that_is_lost(health):
    stream(health, 0.0, 1.0, ONE)
    stream(health, 1.0, 3.0, lost=[ONE])
    assert health.report(3.0)[1][1:3] == (ERROR, "not tracked for 2.0 s")


@pytest.mark.parametrize(("until", "level"), [(1.0, WARN), (3.0, ERROR)])
def test_bodies_that_were_never_seen(health, until, level):
    stream(health, 0.0, until, lost=[ONE])
    _, one, seven = health.report(until)
    assert one[1:3] == (level, "in the stream, but not tracked so far")
    assert seven.level == level
    assert seven.message == "not in the stream so far; it shows no others that are not configured"


def test_a_body_that_is_missing_is_reported_with_those_that_are_there(health):
    stream(health, 0.0, 1.0, ONE)
    others = [(2, "cf2"), (3, None), (0, None), (4, ""), (None, ""), (None, None), (None, "wand")]
    for other in others:
        health.other(SeenBody(*other, (0, 0, 0), (0, 0, 0, 1), True))
    assert health.report(1.0)[2].message.endswith("not configured: 2 (cf2), 3, 0, 4 (), , , wand")


def test_what_an_earlier_connection_saw_does_not_count(health):
    stream(health, 0.0, 1.0, ONE)
    health.disconnected("gone")
    health.connected("another server")
    stream(health, 2.0, 3.0, SEVEN)
    _, one, seven = health.report(3.0)
    assert one.message.startswith("not in the stream so far")
    assert seven.level == OK


def test_a_rate_outside_its_limits():
    health = Health(BODIES, 0.2, 0.0, rate_limits=(80.0, 120.0))
    health.connected("a server")
    stream(health, 0.5, 1.0, ONE, SEVEN)
    # Only a part of the first period was streamed.
    assert health.report(1.0)[0].level == OK
    stream(health, 1.0, 2.0, ONE, SEVEN)
    assert health.report(2.0)[0].level == OK
    limited = Health(BODIES, 0.2, 0.0, rate_limits=(120.0, 200.0))
    limited.connected("a server")
    for begin in (0.0, 1.0):
        stream(limited, begin, begin + 1.0, ONE, SEVEN)
        status = limited.report(begin + 1.0)[0]
    assert status[:3] == ("stream", WARN, "100.0 frames per second; expected 120 to 200")
