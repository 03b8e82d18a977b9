"""The model of a radio channel, by numbers from its sources."""

import pytest

from crazyflie_virtual.radio import (
    BROADCAST_GAP,
    ROUND_TRIP,
    SETUP_REQUEST,
    Load,
    RadioChannel,
    air_time,
    usage,
)

#: A frame of 20 vehicles: with its header, the type and two poses, or four positions.
POSES, POSITIONS = (25,) * 10, (30,) * 5


def test_the_air_time_is_the_data_sheets():
    # 1 + 5 bytes, 9 bits, 32 + 2 bytes at 2 Mbit/s.
    assert air_time(32) == pytest.approx(164.5e-6)
    assert air_time(0) == pytest.approx(36.5e-6)
    for size in (-1, 33):
        with pytest.raises(ValueError, match=f"0 to 32 bytes; got {size}"):
            air_time(size)


def polled(vehicles, has_setup_requests):
    channel = RadioChannel(has_setup_requests)
    for i in range(1000):
        channel.unicast(0.0, i % vehicles, 31, 31)
    return 1000 / channel.busy


def test_acknowledged_packets_a_second_are_those_that_were_measured():
    assert polled(1, False) == pytest.approx(1370)
    assert polled(20, False) == pytest.approx(1370)
    assert polled(1, True) == pytest.approx(1370, rel=0.01)
    # With all three setup requests for each packet 300 a second were measured.
    assert 1.0 / (3 * SETUP_REQUEST + ROUND_TRIP) == pytest.approx(300, rel=0.05)


def test_a_broadcast_needs_no_acknowledgement():
    channel = RadioChannel(has_setup_requests=False)
    assert channel.broadcast(1.0, 25) == pytest.approx(1.0 + BROADCAST_GAP)
    assert channel.broadcast(1.0, 25) == pytest.approx(1.0 + 2 * BROADCAST_GAP)
    assert (channel.broadcasts, channel.unicasts) == (2, 0)


def test_twenty_vehicles_at_100_hz_are_within_the_budget():
    found = usage(Load(20, 100.0, POSES), RadioChannel(has_setup_requests=False))
    # 1000 broadcasts of 0.5 ms and 400 packets of 0.73 ms a second.
    assert found.share == pytest.approx(0.5 + 400 / 1370)
    assert found.frame_delay < 0.01
    assert found.poll_delay < 0.02


def test_poses_to_each_vehicle_are_not():
    load = Load(20, 100.0, (), polls=120.0, poll_size=(31, 31))
    assert usage(load, RadioChannel(has_setup_requests=False)).share > 1.0


def test_setup_requests_cost_more_than_packets():
    shares = {
        vehicles: usage(Load(vehicles, 100.0, POSES[: vehicles // 2]), RadioChannel()).share
        for vehicles in (12, 20)
    }
    assert shares[12] < 1.0 < shares[20]
    assert usage(Load(20, 100.0, POSITIONS, polls=10.0), RadioChannel()).share < 1.0
