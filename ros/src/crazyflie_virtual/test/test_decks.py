"""Positioning decks of a virtual vehicle: drift, lost texture, occluded base stations."""

import math
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from virtual_bench import Bench

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware.decks import GEOMETRIES


def go(bench, x, y, duration=3.0):
    data = struct.pack("<BB??5f", 12, 0, False, False, x, y, 1.0, 0.0, duration)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, data)[3] == 0
    bench.run(duration + 1.0)


def error(bench):
    """Return the horizontal distance of the estimate from the true position, m."""
    estimate, (x, y, _) = bench.firmware.estimate, bench.physics.position
    return math.hypot(estimate.x - x, estimate.y - y)


def test_optical_flow_drifts_with_the_way_and_not_with_time():
    """Over seeds the drift has the standard deviation 15 mm a square root of metre, an axis."""
    drifts = []
    for seed in range(12):
        bench = Bench(positioning="flow", seed=seed)
        bench.take_off()
        before = error(bench)
        bench.run(10.0)
        assert error(bench) == pytest.approx(before, abs=0.01)
        go(bench, 2.0, 0.0)
        go(bench, 0.0, 0.0)
        drifts.append(error(bench))
    root_mean_square = math.sqrt(sum(each**2 for each in drifts) / len(drifts))
    # 4 m of way, two axes; the interval holds 99 % of samples of 12.
    assert 0.5 < root_mean_square / (0.015 * math.sqrt(2 * 4.0)) < 1.5


def test_a_restarted_estimator_begins_where_it_is_told_to():
    bench = Bench(positioning="flow")
    bench.run(1.0)
    bench.firmware.estimator.initial_y = 0.5
    bench.firmware.reset_estimation = 1
    bench.run(2.0)
    assert bench.firmware.estimate.y == pytest.approx(0.5, abs=0.01)


def test_without_texture_the_velocity_is_not_measured():
    bench = Bench(positioning="flow", smooth_x=2.0, smooth=0.5)
    bench.take_off()
    assert bench.firmware.variance_velocity < 0.01
    go(bench, 2.0, 0.0)
    assert bench.firmware.variance_velocity > 0.1
    assert error(bench) > 0.0


@pytest.mark.parametrize(
    ("base_stations", "occluded", "active"),
    [(2, 0, 3), (2, 1, 2), (2, 3, 0), (4, 0b101, 0b1010), (16, 0x7FFF, 0x8000)],
)
def test_base_stations_are_occluded(base_stations, occluded, active):
    bench = Bench(positioning="lighthouse", base_stations=base_stations, occluded=occluded)
    bench.run(1.0)
    deck = bench.firmware.deck
    assert deck.located_stations == 2**base_stations - 1
    assert (deck.received, deck.active_stations) == (active, active)
    assert (bench.firmware.estimator.variance_position < 1e-4) is (active > 0)


def test_one_base_station_measures_less_precisely_and_without_geometry_none():
    def variance(**options):
        bench = Bench(positioning="lighthouse", **options)
        bench.run(2.0)
        return bench.firmware.estimator.variance_position

    assert variance() < variance(base_stations=1) < 1e-4 < variance(knows_stations=False)


@pytest.mark.parametrize("yaw", [0.0, 50.0])
@pytest.mark.parametrize("pitch", [30.0, 90.0, -90.0])
def test_the_estimate_is_in_the_frame_of_the_stored_geometry(pitch, yaw):
    bench = Bench(positioning="lighthouse", base_stations=4)
    frame = Rotation.from_euler("ZY", [yaw, pitch], degrees=True)
    form = struct.Struct("<12f?")
    for station, geometry in enumerate(GEOMETRIES[:4]):
        *values, valid = form.unpack(geometry)
        rotation = frame.as_matrix() @ np.reshape(values[3:], (3, 3))
        page = form.pack(*frame.apply(values[:3]), *rotation.flat, valid)
        assert bench.firmware.deck.memory.write(station << 8, page)
    bench.run(2.0)
    found = Rotation.from_quat(bench.firmware.estimate.quaternion)
    assert (frame.inv() * found).magnitude() < math.radians(1.0)


def test_a_hand_carries_the_vehicle_and_lets_it_go():
    bench = Bench(init_yaw=math.pi / 2.0)
    hand = bench.physics.hand
    hand.x, hand.z, hand.yaw = 1.0, 0.5, 45.0
    bench.run(3.0)
    # Forward is along y.
    assert bench.physics.position == pytest.approx((0.0, 1.0, 0.5), abs=1e-6)
    hand.x = hand.z = hand.yaw = 0.0
    bench.run(3.0)
    assert bench.physics.position == pytest.approx((0.0, 0.0, 0.0), abs=0.002)
    bench.take_off()
