"""Bounds, bytes and moments that are calculated by hand, on both sides."""

import math
import re
import struct

import pytest

from crazyflie_link.address import Address
from crazyflie_link.broadcast import is_broadcast
from crazyflie_link.cflib_internals import packet
from crazyflie_link.errors import RefusedError, ValueRangeError
from crazyflie_link.link import LinkHealth, LinkMonitor
from crazyflie_link.localization import Localization, PackedPoses, pack
from crazyflie_link.log import Uptime
from crazyflie_link.subsystem import (
    LARGEST_FLOAT,
    SMALLEST_FLOAT,
    check_byte,
    check_finite,
    check_positive,
)

# Addresses and numbers.


@pytest.mark.parametrize(
    ("uri", "vehicle_id"),
    [
        ("radio://0/25/2M/E7E7E7E7A1", 0xA1),
        ("radio://0/25/2M/E7E7E7E7A1?rate_limit=100", 0xA1),
        ("radio://0/25/2M", 0xE7),
        ("udp://127.0.0.1:19850", None),
    ],
)
def test_the_id_of_a_vehicle_is_the_last_byte_of_its_radio_address(uri, vehicle_id):
    assert Address.parse(uri).vehicle_id == vehicle_id


def test_the_largest_and_the_smallest_numbers_are_sent():
    check_finite("x", LARGEST_FLOAT, -LARGEST_FLOAT)
    check_positive("x", LARGEST_FLOAT)
    check_positive("x", SMALLEST_FLOAT)
    check_byte("x", 0)
    check_byte("x", 255)


@pytest.mark.parametrize(
    ("check", "value"),
    [
        (check_finite, 3.5e38),
        (check_finite, -3.5e38),
        (check_positive, 3.5e38),
        (check_positive, 0.0),
        (check_byte, -1),
        (check_byte, 256),
    ],
)
def test_the_next_ones_are_refused(check, value):
    with pytest.raises(ValueRangeError, match="^x"):
        check("x", value)


@pytest.mark.parametrize(
    "command",
    [
        lambda high_level, value: high_level.take_off(1.0, value),
        lambda high_level, value: high_level.land(0.0, value),
        lambda high_level, value: high_level.go_to((0.0, 0.0, 1.0), 0.0, value),
        lambda high_level, value: high_level.spiral(1.0, (0.0, 0.5), 0.0, value),
        lambda high_level, value: high_level.start_trajectory(1, value),
    ],
)
def test_durations_and_time_scales_are_at_least_0_01(target, flying, command):
    flying.high_level.define_trajectory(1, range(132), 1)
    target.received.clear()
    for value in (1e-30, 0.0099, 0.0, -1.0, float("nan"), float("inf"), 3.5e38):
        with pytest.raises(
            ValueRangeError, match=f"is {re.escape(f'{value:g}')}; expected .* at least 0.01"
        ):
            command(flying.high_level, value)
    assert target.packets(8, 0) == []
    command(flying.high_level, 0.01)
    assert len(target.wait_for_packets(8, 0)) == 1


# The vehicle's clock: it has restarted if it is more than 60 s ahead.


@pytest.mark.parametrize(("time_ms", "has_restarted"), [(61_000, False), (61_001, True)])
def test_a_clock_that_is_ahead_has_restarted(time_ms, has_restarted):
    uptime = Uptime()
    assert not uptime.has_restarted(0, 10.0)
    assert uptime.has_restarted(time_ms, 11.0) == has_restarted


@pytest.mark.parametrize(
    ("arrival", "step_ms", "has_restarted"),
    [
        # The second packet is in time; or 10 s late, which the third one may make up for.
        (11.0, 61_000, False),
        (11.0, 61_001, True),
        (21.0, 71_000, False),
        (21.0, 71_001, True),
    ],
)
def test_a_packet_may_make_up_for_one_that_was_late(arrival, step_ms, has_restarted):
    uptime = Uptime()
    uptime.has_restarted(0, 10.0)
    assert not uptime.has_restarted(1000, arrival)
    assert uptime.has_restarted(1000 + step_ms, arrival + 1.0) == has_restarted


# Log packets of a vehicle that answers pings: four periods may be missing.


def states(monitor, *times, pings=True):
    """Return what the monitor says last, of a vehicle that answers a ping at each time (s)."""
    for time in times:
        if pings:
            monitor.received(time)
        state = monitor.state(time)
    return state


def test_the_quickest_log_block_counts():
    monitor = LinkMonitor(0.0)
    for period in (1.0, 0.2, 1.0):
        monitor.expect_log(period, 0.0)
    assert states(monitor, 0.2, 0.4, 0.6, 0.8) is LinkHealth.ALIVE
    assert states(monitor, 0.9) is LinkHealth.RESTARTED


def test_a_log_block_counts_from_its_start():
    monitor = LinkMonitor(4.9)
    monitor.expect_log(0.2, 5.0)
    assert states(monitor, 5.1, 5.3, 5.5, 5.6, 5.75) is LinkHealth.ALIVE
    assert states(monitor, 5.85) is LinkHealth.RESTARTED


def test_half_the_limit_between_log_packet_and_ping_is_a_restart():
    monitor = LinkMonitor(0.0)
    monitor.expect_log(0.2, 0.0)
    states(monitor, 0.2, 0.42)
    assert states(monitor, 0.6, 0.81, pings=False) is LinkHealth.RESTARTED


def test_after_a_busy_time_log_packets_get_half_a_limit_more():
    monitor = LinkMonitor(0.0)
    monitor.expect_log(0.2, 0.0)
    # Due from 5.0 - 0.45 / 2 + 0.8 = 5.575 on.
    assert states(monitor, 5.0, 5.2, 5.4, 5.57) is LinkHealth.ALIVE
    assert states(monitor, 5.58) is LinkHealth.RESTARTED


def test_a_packet_of_the_limit_s_age_is_not_too_old():
    monitor = LinkMonitor(0.0)
    assert states(monitor, 0.2, 0.4, 0.45, pings=False) is LinkHealth.ALIVE
    assert states(monitor, 0.451, pings=False) is LinkHealth.SILENT


def test_more_than_half_a_limit_between_two_looks_is_a_busy_machine():
    monitor = LinkMonitor(0.0)
    # The period begins at 0.23 - 0.45 / 2 = 0.005.
    assert states(monitor, 0.23, 0.4, 0.453, pings=False) is LinkHealth.ALIVE
    assert states(monitor, 0.456, pings=False) is LinkHealth.SILENT


@pytest.mark.parametrize(("answered", "is_poor"), [(3, True), (4, False)])
def test_a_link_is_poor_when_three_of_five_pings_are_answered(answered, is_poor):
    monitor = LinkMonitor(0.0)
    # The answer to the last one may be under way.
    for k in range(6):
        monitor.ping_sent(bytes([k]))
    for k in range(answered):
        monitor.ping_answered(bytes([k]), 0.0)
    assert monitor.is_poor() == is_poor


def test_the_quality_is_that_of_the_last_twenty_pings():
    monitor = LinkMonitor(0.0)
    for k in range(21):
        monitor.ping_sent(bytes([k]))
    monitor.ping_answered(b"\1", 0.0)
    assert monitor.quality() == pytest.approx(1 / 19)


def test_over_udp_a_broadcast_has_no_bits_of_the_link():
    sent = packet(7, 0, b"\0")
    assert not is_broadcast(sent)
    sent.header &= 0xF3
    assert is_broadcast(sent)


# Packed poses (crtp_localization_service.c): 16 bits of mm, and 32 of the quaternion, whose first
# two name the largest component.


def test_positions_are_packed_by_four():
    poses = {k: ((1.0, -2.0, 0.5), None) for k in range(5)}
    packets = pack(poses)
    one = [struct.pack("<B3h", k, 1000, -2000, 500) for k in range(5)]
    assert [bytes(each.data) for each in packets] == [b"".join(one[:4]), one[4]]
    assert [(each.port, each.channel) for each in packets] == [(6, 2)] * 2


def test_poses_are_packed_by_two():
    poses = {k: ((1.0, -2.0, 0.5), (0.0, 0.0, 0.0, 1.0)) for k in range(3)}
    packets = pack(poses)
    one = [struct.pack("<B3hI", k, 1000, -2000, 500, 3 << 30) for k in range(3)]
    assert [bytes(each.data) for each in packets] == [b"\x09" + one[0] + one[1], b"\x09" + one[2]]
    assert [(each.port, each.channel) for each in packets] == [(6, 1)] * 2


class Streams:
    """A broadcaster that keeps what it is to send."""

    def __init__(self):
        self.frames = {}

    def put_latest(self, stream, frame):
        """Keep what makes the packets."""
        self.frames[stream] = frame


def test_the_poses_of_a_frame_are_sent_once():
    broadcaster = Streams()
    poses = PackedPoses(broadcaster)
    poses.vehicles = 2
    for _ in range(2):
        for vehicle_id in (1, 2):
            poses.put(vehicle_id, ((0.0, 0.0, 0.0), None))
        (frame,) = broadcaster.frames.values()
        (sent,) = frame()
        assert [sent.data[0], sent.data[7]] == [1, 2]
        # That of a pose that came while the frame was made.
        assert frame() == []
        broadcaster.frames.clear()


def test_poses_go_on_after_a_frame_that_an_urgent_command_has_discarded():
    broadcaster = Streams()
    poses = PackedPoses(broadcaster)
    poses.vehicles = 2
    poses.put(1, ((0.0, 0.0, 0.0), None))
    # As `Transmission.put` does with an emergency stop of all vehicles.
    broadcaster.frames.clear()
    poses.put(2, ((0.0, 0.0, 0.0), None))
    (frame,) = broadcaster.frames.values()
    (sent,) = frame()
    assert [sent.data[0], sent.data[7]] == [1, 2]


@pytest.mark.parametrize(("x", "is_packed"), [(32.767, True), (-32.767, True), (-32.768, False)])
def test_a_pose_is_packed_if_it_fits_in_16_bits(target, flying, x, is_packed):
    packed = PackedPoses(Streams())
    localization = Localization(flying.link)
    localization.broadcast_by(packed, 1)
    localization.position(0.0, x, 0.0)
    assert bool(packed._broadcaster.frames) == is_packed


# Setpoints and commands.


def test_setpoints_at_their_bounds(target, flying):
    for count, thrust in enumerate((0, 65535), start=1):
        flying.setpoints.attitude(0.0, 0.0, 0.0, thrust)
        sent = target.wait_for_packets(3, 0, count)[-1]
        assert sent[-2:] == struct.pack("<H", thrust)
    flying.setpoints.notify_setpoints_stop(2**32 - 1)
    for too_many in (-1, 2**32):
        with pytest.raises(ValueRangeError, match="is not in 0 to"):
            flying.setpoints.notify_setpoints_stop(too_many)
    for thrust in (-1, 65536):
        with pytest.raises(ValueRangeError, match="expected 0 to 65535 PWM"):
            flying.setpoints.attitude(0.0, 0.0, 0.0, thrust)
    zero, full_state = [0.0, 0.0, 0.0], flying.setpoints.full_state
    with pytest.raises(ValueRangeError, match=r"-33 is outside \+-32.767"):
        full_state(zero, [-33.0, 0.0, 0.0], zero, [0.0, 0.0, 0.0, 1.0], zero)
    full_state(zero, [32.767, -32.767, 0.0], zero, [0.0, 0.0, 0.0, 1.0], zero)
    (data,) = target.wait_for_packets(7, 0)
    assert struct.unpack_from("<3h", data, 7) == (32767, -32767, 0)


def test_a_spiral_is_one_turn_at_most_between_radii_that_are_not_negative(target, flying):
    spiral = flying.high_level.spiral
    spiral(2.0 * math.pi, (0.0, 0.5), 0.25, 3.0, is_clockwise=True, group_mask=4)
    assert target.packets(8, 0) == [
        struct.pack("<4B5f", 11, 4, 0, 1, 2.0 * math.pi, 0.0, 0.5, 0.25, 3.0)
    ]
    spiral(-2.0 * math.pi, (0.5, 0.0), -0.25, 3.0)
    for angle, radii, text in (
        (6.3, (0.0, 0.5), "angle is 6.3 rad"),
        (-6.3, (0.0, 0.5), "angle is -6.3 rad"),
        (1.0, (-0.01, 0.5), "radius is -0.01 m"),
        (1.0, (0.5, -0.01), "radius is -0.01 m"),
    ):
        with pytest.raises(ValueRangeError, match=text):
            spiral(angle, radii, 0.25, 3.0)
    assert len(target.packets(8, 0)) == 2


@pytest.mark.parametrize(("protocol", "is_known"), [(7, False), (8, True)])
def test_commands_that_older_firmware_does_not_know(make_vehicle, make_link, protocol, is_known):
    target = make_vehicle(protocol=protocol)
    link = make_link(target.uri)
    link.connect()
    for command in (
        lambda h: h.go_to((0.0, 0.0, 1.0), 0.0, 2.0, linear=True),
        lambda h: h.spiral(1.0, (0.5, 0.5), 0.0, 2.0),
    ):
        if is_known:
            command(link.high_level)
        else:
            with pytest.raises(RefusedError, match="this firmware has no.* update it"):
                command(link.high_level)
    assert [data[0] for data in target.packets(8, 0)] == ([12, 11] if is_known else [])
