"""Messages of the NatNet server against the client library's parser."""

import math
import struct

import numpy as np
import pytest
from natnet.data_descriptions import DataDescriptions
from natnet.data_frame import DataFrame
from natnet.packet_buffer import PacketBuffer
from natnet.server_info import ServerInfo
from natnet.version import Version
from scipy.spatial.transform import Rotation

from crazyflie_virtual import natnet
from crazyflie_virtual.mocap import MocapScene, MocapSettings
from crazyflie_virtual.natnet import Encoder, StreamedBody
from crazyflie_virtual.server import Observation

BODIES = [
    StreamedBody(1, "cf1", (1.0, 2.0, 3.0), (0.0, 0.0, 0.6, 0.8), True),
    StreamedBody(9, "cf9", (4.0, 5.0, 6.0), (0.5, 0.5, 0.5, 0.5), False),
]


@pytest.fixture(params=natnet.VERSIONS)
def version(request):
    return request.param


def read(parser, message, number, version):
    """Return what the client library makes of a message, all of which it has to use."""
    assert struct.unpack_from("<HH", message) == (number, len(message) - 4)
    buffer = PacketBuffer(message[4:])
    parsed = parser.read_from_buffer(buffer, Version.from_str(version))
    return parsed, len(message) - 4 - buffer.pointer


def test_server_info(version):
    message = Encoder(version).server_info("an application", 1511, "239.255.42.99")
    info, rest = read(ServerInfo, message, natnet.SERVER_INFO, version)
    assert info.application_name == "an application"
    assert str(info.nat_net_protocol_version) == f"{version}.0.0"
    assert rest == 15
    tail = struct.unpack("<QHB4B", message[-15:])
    assert tail == (natnet.CLOCK_FREQUENCY, 1511, 1, 239, 255, 42, 99)
    unicast = Encoder(version).server_info("an application", 1511, None)
    assert unicast[-5:] == bytes(5)


def test_model(version):
    message = Encoder(version).model(BODIES)
    model, rest = read(DataDescriptions, message, natnet.MODEL, version)
    assert rest == 0
    assert [(b.name, b.id_num) for b in model.rigid_bodies] == [("cf1", 1), ("cf9", 9)]


def test_frame(version):
    message = Encoder(version).frame(77, BODIES, 1.5, 1.6, 1.7)
    frame, rest = read(DataFrame, message, natnet.FRAME, version)
    # The end mark, which the library leaves; of version 4.1 it does not know the precision
    # time stamp, 8 bytes before the flags.
    assert rest == (12 if version == "4.1" else 4)
    assert frame.prefix.frame_number == 77
    first, second = frame.rigid_bodies
    assert (first.id_num, first.pos, first.tracking_valid) == (1, (1.0, 2.0, 3.0), True)
    assert first.rot == pytest.approx((0.0, 0.0, 0.6, 0.8))
    assert (second.id_num, second.tracking_valid) == (9, False)
    assert frame.suffix.timestamp == 1.5
    if version != "2.9":
        assert frame.suffix.stamp_camera_mid_exposure == 1_500_000_000
        assert frame.suffix.stamp_transmit == 1_700_000_000


def test_unlabelled_markers(version):
    places = [(1.0, 2.0, 3.0), (-0.5, 0.25, 0.0)]
    message = Encoder(version).frame(77, BODIES, 1.5, 1.6, 1.7, places)
    frame, rest = read(DataFrame, message, natnet.FRAME, version)
    assert rest == (12 if version == "4.1" else 4)
    assert list(frame.unlabeled_marker_pos) == places
    assert [marker.pos for marker in frame.labeled_markers] == places
    assert all(marker.unlabeled and not marker.occluded for marker in frame.labeled_markers)
    assert frame.suffix.timestamp == 1.5


@pytest.mark.parametrize(
    ("version", "form", "stamps"),
    [
        ("2.9", "<IIdhI", ()),
        ("3.1", "<IId3QhI", (1_500_000_000, 1_600_000_000, 1_700_000_000)),
        # With the precision time stamp: seconds, and their fraction.
        ("4.1", "<IId3QIIhI", (1_500_000_000, 1_600_000_000, 1_700_000_000, 0, 0)),
    ],
)
def test_the_end_of_a_frame(version, form, stamps):
    message = Encoder(version).frame(77, [], 1.5, 1.6, 1.7)
    end = struct.unpack(form, message[-struct.calcsize(form) :])
    assert end == (0, 0, 1.5, *stamps, 0, 0)
    # The number and the counts precede it, from 4.1 on with sizes; all are zero.
    counts = {"2.9": 6, "3.1": 7, "4.1": 16}[version]
    assert len(message) == 4 + 4 + 4 * counts + struct.calcsize(form)


def test_echo():
    message = natnet.echo(struct.pack("<Q", 123), 2.0)
    assert struct.unpack("<HHQQ", message) == (natnet.ECHO_RESPONSE, 16, 123, 2_000_000_000)


# The scene.


def observation(time, body_id=1, **changes):
    fields = {
        "position": (1.0, 2.0, 3.0),
        "velocity": (0.0, 0.0, 0.0),
        "quaternion": (0.0, 0.0, 0.0, 1.0),
        "rates": (0.0, 0.0, 0.0),
    }
    return Observation(body_id, f"cf{body_id}", time, **{**fields, **changes})


def test_bodies_go_on_between_observations():
    scene = MocapScene(MocapSettings())
    scene.observe(observation(10.0, velocity=(1.0, -2.0, 0.5), rates=(0.0, 0.0, 2.0)))
    (body,) = scene.bodies(10.01)
    np.testing.assert_allclose(body.position, (1.01, 1.98, 3.005))
    expected = Rotation.from_rotvec((0.0, 0.0, 0.02))
    assert (expected.inv() * Rotation.from_quat(body.quaternion)).magnitude() < 1e-5
    assert body.is_tracked


def test_a_vehicle_that_is_gone_is_not_tracked():
    scene = MocapScene(MocapSettings())
    scene.observe(observation(10.0))
    assert scene.bodies(10.4)[0].is_tracked
    (body,) = scene.bodies(10.6)
    assert not body.is_tracked
    assert body.position == (1.0, 2.0, 3.0)


def test_invalid_bodies_keep_the_pose_they_were_seen_at():
    scene = MocapScene(MocapSettings(invalid="2, 5"))
    scene.observe(observation(10.0, 1))
    scene.observe(observation(10.0, 2))
    assert [b.is_tracked for b in scene.bodies(10.0)] == [True, False]
    scene.switches.invalid = "all"
    scene.observe(observation(10.1, 1, position=(9.0, 9.0, 9.0)))
    assert [b.is_tracked for b in scene.bodies(10.1)] == [False, False]
    assert scene.bodies(10.1)[0].position == (1.0, 2.0, 3.0)


def test_dropout_takes_its_share():
    scene = MocapScene(MocapSettings(dropout=0.25))
    tracked = 0
    for k in range(4000):
        scene.observe(observation(0.01 * k))
        tracked += scene.bodies(0.01 * k)[0].is_tracked
    assert tracked == pytest.approx(3000, abs=150)


def test_noise_has_its_deviations():
    settings = MocapSettings(position_noise=0.002, attitude_noise=0.01, seed=3)
    scene = MocapScene(settings)
    positions, angles = [], []
    for k in range(2000):
        scene.observe(observation(0.01 * k))
        (body,) = scene.bodies(0.01 * k)
        positions.append(body.position)
        angles.append(Rotation.from_quat(body.quaternion).as_rotvec())
    np.testing.assert_allclose(np.std(positions, axis=0), 0.002, rtol=0.1)
    np.testing.assert_allclose(np.std(angles, axis=0), 0.01, rtol=0.1)
    assert all(math.isclose(math.hypot(*b.quaternion), 1.0) for b in scene.bodies(19.99))


def test_vehicles_with_one_marker_are_no_rigid_bodies():
    scene = MocapScene(MocapSettings(invalid="3", single_markers="2, 3"))
    for number in (1, 2, 3):
        scene.observe(observation(10.0, number, position=(float(number), 0.0, 1.0)))
    assert [body.body_id for body in scene.bodies(10.0)] == [1]
    assert scene.markers(10.0) == [(2.0, 0.0, 1.0)]


def test_reflections_and_occlusions():
    scene = MocapScene(MocapSettings(ghosts=0.5, occlusions=1.0, single_markers="all"))
    shown = []
    for k in range(2400):
        scene.observe(observation(k / 120.0))
        shown.append(scene.markers(k / 120.0))
    place = shown[0][0] if len(shown[0]) == 1 else None
    ghosts = sum(point != place for points in shown for point in points)
    hidden = sum(place not in points for points in shown)
    assert ghosts == pytest.approx(1200, rel=0.15)
    # Once a second, for 0.15 s in the mean.
    assert 0.05 < hidden / len(shown) < 0.25
