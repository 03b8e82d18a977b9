"""NatNet messages: those of the virtual server, and one that is built here by hand."""

import contextlib
import math
import struct
import time
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_virtual.natnet import VERSIONS, Encoder, StreamedBody
from mocap_optitrack import natnet_messages as natnet
from mocap_optitrack.frames import SeenBody

FREQUENCY = 1_000_000_000
POSES = [
    StreamedBody(1, "cf1", (1.0, 2.0, 3.0), (0.0, 0.0, 0.5, 0.5), True),
    StreamedBody(7, "cf7", (-1.0, 0.5, 0.25), (0.0, 0.0, 0.0, 1.0), False),
]
NAMES = {1: "cf1", 7: "cf7"}


def payload(message, number):
    """Return the payload of a message that must have this number."""
    found, content = natnet.split(message)
    assert found == number
    return content


@pytest.mark.parametrize("version", VERSIONS)
def test_server_infos(version):
    message = Encoder(version).server_info("virtual", 1511, "239.255.42.99")
    info = natnet.read_server_info(payload(message, natnet.SERVER_INFO))
    assert info == ("virtual", version, FREQUENCY, True, "239.255.42.99", 1511)


def test_the_server_info_of_a_unicast_server():
    message = Encoder("3.1").server_info("virtual", 1511, None)
    info = natnet.read_server_info(payload(message, natnet.SERVER_INFO))
    assert info == ("virtual", "3.1", FREQUENCY, False, None, 1511)


def test_the_server_info_of_an_old_server():
    content = struct.pack("<256s8B", b"Tracking Tools", 2, 5, 0, 0, 2, 5, 0, 0)
    info = natnet.read_server_info(content)
    assert info == ("Tracking Tools", "2.5", None, None, None, None)


@pytest.mark.parametrize("version", VERSIONS)
def test_names(version):
    message = Encoder(version).model(POSES)
    assert natnet.read_names(payload(message, natnet.MODEL), version) == NAMES


@pytest.mark.parametrize("version", VERSIONS)
def test_frames(version):
    message = Encoder(version).frame(5, POSES, 100.0, 100.002, 100.005)
    frame = natnet.read_frame(payload(message, natnet.FRAME), version, FREQUENCY, NAMES, 7.5)
    assert frame.arrival == 7.5
    assert frame.bodies == tuple(SeenBody(*pose) for pose in POSES)
    assert frame.exposure == pytest.approx(100.0, abs=1e-9)
    # Before version 3.0 there is but one time.
    assert frame.sent == pytest.approx(100.005 if version >= "3.0" else 100.0, abs=1e-9)


def test_a_server_with_ptp_is_read_like_one_without():
    message = payload(Encoder("4.1").frame(5, POSES, 100.0, 100.002, 100.005), natnet.FRAME)
    # The precision time stamp is before flags and end mark.
    precise = message[:-14] + struct.pack("<II", 1_700_000_000, 0x80000000) + message[-6:]
    read = [natnet.read_frame(each, "4.1", FREQUENCY, NAMES, 7.5) for each in (message, precise)]
    assert read[0] == read[1]


@pytest.mark.parametrize(
    ("exposure", "received", "expected"),
    [(5_000_000, 5_020_000, 0.5), (0, 5_020_000, 0.502), (0, 0, 0.505)],
)
def test_times_are_those_of_the_servers_clock(exposure, received, expected):
    content = full_frame_3_0(exposure, received, sent=5_050_000)
    frame = natnet.read_frame(content, "3.0", 10_000_000, {}, 0.0)
    assert (frame.exposure, frame.sent) == pytest.approx((expected, 0.505))


def test_without_the_frequency_of_the_clock_there_is_one_time():
    content = full_frame_3_0(5_000_000, 5_020_000, 5_050_000)
    frame = natnet.read_frame(content, "3.0", None, {}, 0.0)
    assert (frame.exposure, frame.sent) == (77.25, 77.25)


def test_rigid_bodies_are_found_among_everything_else():
    content = full_frame_3_0(1, 2, 3)
    frame = natnet.read_frame(content, "3.0", 10_000_000, {12: "wand"}, 0.0)
    assert frame.bodies == (
        SeenBody(12, "wand", (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), True),
        SeenBody(13, None, (4.0, 5.0, 6.0), (0.0, 1.0, 0.0, 0.0), False),
    )


def full_frame_3_0(exposure, received, sent):
    """Return a frame of NatNet 3.0 with some of everything, by the definition of the stream."""
    marker_set = b"all\0" + struct.pack("<i6f", 2, *range(6))
    unlabelled = struct.pack("<3f", 7, 8, 9)
    body = "<i7ffh"
    bodies = struct.pack(body, 12, 1, 2, 3, 0, 0, 0, 1, 0.001, 1)
    bodies += struct.pack(body, 13, 4, 5, 6, 0, 1, 0, 0, 0.0, 0)
    skeleton = struct.pack("<ii", 1, 1) + struct.pack(body, 99, 0, 0, 0, 0, 0, 0, 1, 0.0, 1)
    labelled = struct.pack("<i3ffhf", 65537, 1, 2, 3, 0.01, 0, 0.001)
    force_plate = struct.pack("<iiif", 1, 1, 1, 5.0)
    device = struct.pack("<iiiff", 2, 1, 2, 5.0, 6.0)
    sections = [
        (1, marker_set),
        (1, unlabelled),
        (2, bodies),
        (1, skeleton),
        (1, labelled),
        (1, force_plate),
        (1, device),
    ]
    content = struct.pack("<i", 1234)
    for count, section in sections:
        content += struct.pack("<i", count) + section
    content += struct.pack("<IId3Q", 0, 0, 77.25, exposure, received, sent)
    return content + struct.pack("<hi", 0, 0)


def test_before_version_2_6_a_body_without_a_pose_is_not_tracked():
    def frame_2_5(*pose):
        body = struct.pack("<i7fif", 1, *pose, 0, 0.0)
        counts = struct.pack("<iii", 0, 0, 1), struct.pack("<ii", 0, 0)
        return (
            struct.pack("<i", 5) + counts[0] + body + counts[1] + struct.pack("<IIfh", 0, 0, 1, 0)
        )

    def is_tracked(*pose):
        return natnet.read_frame(frame_2_5(*pose), "2.5", None, {}, 0.0).bodies[0].is_tracked

    assert is_tracked(0, 0, 1, 0, 0, 0, 1)
    assert is_tracked(0, 0, 0, 0, 0, 0, 1)
    assert not is_tracked(0, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize("datagram", [b"", b"\7\0", b"\7\0\5\0abc"])
def test_what_is_no_message(datagram):
    with pytest.raises(natnet.DecodeError, match="bytes"):
        natnet.split(datagram)


@given(st.integers(0, 120), st.sampled_from(VERSIONS))
def test_a_message_that_was_cut_off_is_refused(length, version):
    whole = payload(Encoder(version).frame(5, POSES, 1.0, 1.0, 1.0), natnet.FRAME)
    assert length < len(whole) - 8
    with pytest.raises(natnet.DecodeError, match=f"NatNet {version} of {length} bytes"):
        natnet.read_frame(whole[:length], version, FREQUENCY, {}, 0.0)


@pytest.mark.parametrize(
    "content",
    [
        # A marker set with four thousand million names.
        struct.pack("<ii", 1, 0) + b"set\0" + b"\xff" * 4,
        # A rigid body with as many markers.
        struct.pack("<ii", 1, 1) + b"cf1\0" + struct.pack("<ii3f", 1, -1, 0, 0, 0) + b"\xff" * 4,
        # As many data sets.
        b"\xff" * 4,
    ],
)
def test_numbers_that_cannot_be_are_refused_at_once(content):
    with pytest.raises(natnet.DecodeError, match="cannot decode"):
        natnet.read_names(content, "3.1")


def test_a_force_plate_with_too_many_channels_is_refused_at_once():
    content = struct.pack("<7i", 5, 0, 0, 0, 0, 0, 1) + struct.pack("<ii", 1, 1) + b"\xff" * 4
    with pytest.raises(natnet.DecodeError, match="cannot decode"):
        natnet.read_frame(content, "3.1", FREQUENCY, {}, 0.0)


def read(datagram, version):
    """Read a datagram, whatever it is, as the client does."""
    number, content = natnet.split(datagram)
    if number == natnet.SERVER_INFO:
        natnet.read_server_info(content)
    elif number == natnet.MODEL:
        natnet.read_names(content, version)
    elif number == natnet.FRAME:
        frame = natnet.read_frame(content, version, FREQUENCY, {}, 0.0)
        assert all(map(math.isfinite, (frame.exposure, frame.sent)))


def assert_refused_or_read(datagram, version):
    """Read a datagram; the one exception that is allowed is the documented one."""
    with contextlib.suppress(natnet.DecodeError):
        read(datagram, version)


def datagram(number, content):
    """Return a message with a header that fits."""
    return struct.pack("<HH", number, len(content)) + content


def valid(number, version):
    """Return a message of the virtual server, or, of version 3.0, one with all there is."""
    if number == natnet.SERVER_INFO:
        return Encoder("4.1").server_info("virtual", 1511, "239.255.42.99")
    if number == natnet.FRAME and version == "3.0":
        return datagram(number, full_frame_3_0(5_000_000, 5_020_000, 5_050_000))
    encoder = Encoder("3.1" if version == "3.0" else version)
    if number == natnet.MODEL:
        return encoder.model(POSES)
    return encoder.frame(5, POSES, 100.0, 100.002, 100.005)


NUMBERS = st.sampled_from([natnet.SERVER_INFO, natnet.MODEL, natnet.FRAME])
READABLE = st.sampled_from(["2.5", "2.9", "3.0", "3.1", "4.1"])


@given(st.binary(max_size=400), READABLE)
def test_noise(content, version):
    assert_refused_or_read(content, version)


@given(NUMBERS, st.binary(max_size=400), READABLE)
def test_noise_with_a_header_that_fits(number, content, version):
    assert_refused_or_read(datagram(number, content), version)


@given(NUMBERS, st.sampled_from(["2.9", "3.0", "3.1", "4.1"]), st.data())
def test_valid_messages_with_bytes_changed_cut_out_or_added(number, version, data):
    content = valid(number, version)[4:]
    for _ in range(data.draw(st.integers(1, 4))):
        begin = data.draw(st.integers(0, len(content)))
        end = data.draw(st.integers(begin, min(begin + 8, len(content))))
        content = content[:begin] + data.draw(st.binary(max_size=8)) + content[end:]
    assert_refused_or_read(datagram(number, content), version)
    # And in a stream of another version.
    assert_refused_or_read(datagram(number, content), data.draw(READABLE))


@pytest.mark.parametrize("version", ["2.9", "4.1"])
@pytest.mark.parametrize("number", [natnet.MODEL, natnet.FRAME])
@pytest.mark.parametrize("filling", [b"\0", b"\1\0\0\0", b"a\0\0\0\0"])
@pytest.mark.parametrize("first", [(1, 0), (0x7FFFFFFF, 0)])
def test_the_largest_datagrams_take_little_time_and_memory(number, version, filling, first):
    # As many names, bodies or channels as fit, and numbers that say there are more.
    room = 65507 - 12
    content = struct.pack("<ii", *first) + (filling * room)[:room]
    tracemalloc.start()
    begin = time.process_time()
    try:
        assert_refused_or_read(datagram(number, content), version)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert time.process_time() - begin < 5.0
    assert peak < 50e6


@pytest.mark.parametrize("stamp", [math.nan, math.inf])
def test_a_frame_without_a_time_is_refused(stamp):
    message = Encoder("2.9").frame(5, POSES, stamp, 0.0, 0.0)
    with pytest.raises(natnet.DecodeError, match="has no time"):
        natnet.read_frame(payload(message, natnet.FRAME), "2.9", FREQUENCY, {}, 0.0)


def test_requests():
    assert natnet.request(natnet.CONNECT, "Ping") == b"\0\0\5\0Ping\0"
    assert natnet.request(natnet.KEEP_ALIVE) == b"\x0a\0\1\0\0"
