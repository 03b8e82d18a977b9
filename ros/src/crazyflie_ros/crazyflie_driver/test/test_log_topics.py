"""Data that the vehicle sends by itself, as messages."""

import time

import pytest

from crazyflie_driver.driver_parameters import STANDARD_TOPICS
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until

ALL = {f"enable_logging_{name}": True for name in STANDARD_TOPICS}


def published(server, topic, count=1):
    """Wait for messages on a topic and return them."""
    wait_until(lambda: len(server.process.published(topic)) >= count, f"messages on {topic}")
    return server.process.published(topic)


@pytest.fixture
def logging(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, enable_logging=True, **ALL)
    return vehicle


def test_standard_topics_are_those_of_the_cpp_driver(server, logging):
    imu = published(server, "/cf1/imu")[0]
    assert (imu.header.frame_id, imu.header.stamp.to_sec()) == ("cf1/base_link", 100.0)
    acceleration, rate = imu.linear_acceleration, imu.angular_velocity
    assert (acceleration.x, acceleration.y, acceleration.z) == pytest.approx((4.905, -2.4525, 9.81))
    assert (rate.x, rate.y, rate.z) == pytest.approx((1.5707963, -3.1415927, 0.7853982))
    assert imu.orientation_covariance[0] == -1.0

    pose = published(server, "/cf1/pose")[0]
    assert pose.header.frame_id == "world"
    position, orientation = pose.pose.position, pose.pose.orientation
    assert (position.x, position.y, position.z) == (1.5, -2.5, 0.75)
    assert (orientation.x, orientation.y, orientation.z, orientation.w) == pytest.approx(
        (0.7071068, 0.0, 0.0, 0.7071068)
    )

    field = published(server, "/cf1/magnetic_field")[0].magnetic_field
    assert (field.x, field.y, field.z) == (0.5, -0.25, 1.0)
    assert published(server, "/cf1/temperature")[0].temperature == 25.5
    assert published(server, "/cf1/pressure")[0].data == 1013.25
    assert published(server, "/cf1/battery")[0].data == 3.75
    assert published(server, "/cf1/rssi")[0].data == 47.0
    assert published(server, "/cf1/heading")[0].data == pytest.approx(1.5707963)


def test_standard_topics_need_five_log_blocks(logging):
    """Status, estimate, imu, pose, and the slow ones together: 16 there are."""
    created = [data for data in logging.packets(5, 1) if data[0] == 6]
    started = [data[2] for data in logging.packets(5, 1) if data[0] == 3]
    assert len(created) == 5
    assert sorted(started) == [1, 1, 10, 10, 50]


def test_stamps_of_the_vehicle_s_time_go_on_when_its_24_bits_are_full(server):
    vehicle = server.make_vehicle()
    # 0.7 s before its clock wraps, after 4.66 h.
    vehicle.flight.clock_ahead_ms = (1 << 24) - 700 - int(time.monotonic() * 1000)
    server.add(vehicle.uri, use_ros_time=False, enable_logging=True, enable_logging_imu=True)
    full = (1 << 24) / 1000.0

    def stamps():
        return [message.header.stamp.to_sec() for message in server.process.published("/cf1/imu")]

    wait_until(lambda: len(stamps()) > 3 and not full - 2.0 < stamps()[-1] < full + 0.1)
    assert min(stamps()) < full
    assert stamps() == sorted(stamps())
    assert stamps()[-1] < full + 60.0


def test_packets_of_others(server, logging):
    count = len(server.process.published("/cf1/packets"))
    logging.send(13, 2, b"app data")
    packet = published(server, "/cf1/packets", count + 1)[count]
    assert (packet.size, packet.header) == (9, 0xDE)
    assert bytes(packet.data) == b"app data".ljust(30, b"\0")


def test_packets_of_the_largest_size_and_without_logging(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, enable_logging_packets=True)
    for port, channel in ((0, 0), (2, 1), (4, 1), (5, 1), (8, 0), (9, 0), (15, 3)):
        vehicle.send(port, channel, b"the driver's own")
    vehicle.send(14, 3, bytes(range(30)))
    packet = published(server, "/cf1/packets")[0]
    assert (packet.size, packet.header, bytes(packet.data)) == (31, 0xEF, bytes(range(30)))


def test_the_frequency_of_a_custom_block_is_a_period_in_ms(server, log_block):
    vehicle = server.make_vehicle()
    blocks = [log_block("motors", 20, "motor.m1", "pm.vbat"), log_block("slow", 1000, "mag.x")]
    server.add(vehicle.uri, enable_logging=True, log_blocks=blocks)
    started = [data[2] for data in vehicle.packets(5, 1) if data[0] == 3]
    assert sorted(started) == [2, 10, 50, 100]
    message = published(server, "/cf1/motors", 2)[0]
    assert message.values == [4321.0, 3.75]
    assert message.header.frame_id == "cf1/base_link"
    assert published(server, "/cf1/slow")[0].values == [0.5]


def test_a_period_between_two_steps_is_the_shorter_one_and_said(server, log_block):
    """Launch files of the C++ driver, which cuts it silently, go on working."""
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, enable_logging=True, log_blocks=[log_block("motors", 25, "motor.m1")])
    assert sorted(data[2] for data in vehicle.packets(5, 1) if data[0] == 3) == [2, 10, 50]
    (warning,) = server.process.logged("warn")
    assert "log block motors: its period is 25 ms" in warning
    assert "it comes every 20 ms" in warning


def test_stamps_of_the_vehicle(server, log_block):
    vehicle = server.make_vehicle()
    server.add(
        vehicle.uri,
        enable_logging=True,
        use_ros_time=False,
        log_blocks=[log_block("test", 10, "mag.x")],
    )
    messages = published(server, "/cf1/test", 5)
    stamps = [message.header.stamp.to_sec() for message in messages]
    # 24 bits of milliseconds.
    assert all(0.0 <= stamp < 16777.216 for stamp in stamps)
    assert stamps == sorted(stamps)
    assert stamps[-1] > stamps[0]


def test_without_logging_there_are_only_status_estimate_and_packets(server, log_block):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, log_blocks=[log_block("test", 10, "mag.x")], **ALL)
    assert len([data for data in vehicle.packets(5, 1) if data[0] == 6]) == 2
    assert set(server.process.transport.publishers) == {
        "/diagnostics",
        "/flights",
        "/cf1/connected",
        "/cf1/heading",
        "/cf1/rssi",
        "/cf1/status",
        "/cf1/vehicle_status",
        "/cf1/packets",
    }


def test_topics_that_the_firmware_cannot_fill_are_left_out(server):
    vehicle = server.make_vehicle()
    del vehicle.log["baro.temp"]
    server.add(vehicle.uri, enable_logging=True, **ALL)
    assert "/cf1/temperature" not in server.process.transport.publishers
    assert published(server, "/cf1/pressure")[0].data == 1013.25
    assert "no topic temperature: the firmware has no baro.temp" in server.process.logged("warn")[0]


@pytest.mark.parametrize(
    ("blocks", "text"),
    [
        ([("test", 10, "mag.X")], "did you mean mag.x"),
        (
            [("test", 5, "mag.x")],
            "log_blocks/frequency is .5.; expected a list, each entry an integer from 10",
        ),
        ([("test", 100)], "no variables"),
        ([("test", 100, "mag.x"), ("test", 10, "mag.x")], "two log blocks are called 'test'"),
        ([("imu", 100, "mag.x")], "log_blocks/topic_name is .*the driver itself has a topic 'imu'"),
        ([("cmd_hover", 100, "mag.x")], "the driver itself has a topic 'cmd_hover'"),
        ([("my log", 100, "mag.x")], "'my log'.; expected a list, each entry the name of a topic"),
    ],
)
def test_custom_blocks_that_are_not_possible(server, log_block, blocks, text):
    vehicle = server.make_vehicle()
    blocks = [log_block(*block) for block in blocks]
    with pytest.raises(ServiceError, match=text):
        server.add(vehicle.uri, enable_logging=True, log_blocks=blocks)
