"""From a ROS message to the bytes on the link."""

import math
import struct

import pytest
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Twist, Vector3
from std_msgs.msg import Empty as EmptyMessage

from crazyflie_driver.driver_parameters import INPUT_TOPICS
from crazyflie_driver.msg import FullState, Hover, Position, VelocityWorld
from crazyflie_driver.setpoint_gate import OVERLAP
from crazyflie_driver.setpoint_topics import CMD_STOP, CMD_VEL, EXTERNAL, SETPOINTS

NAN = math.nan


def cmd_vel(x=0.0, y=0.0, z=0.0, yaw=0.0):
    return Twist(Vector3(x, y, z), Vector3(0.0, 0.0, yaw))


def test_cmd_vel(flying):
    """Roll and yaw rate as they are, pitch negated, thrust as an integer."""
    server, vehicle = flying
    server.process.publish("/cf1/cmd_vel", cmd_vel(x=10.0, y=-5.0, z=42000.9, yaw=-30.0))
    assert vehicle.wait_for_packets(3, 0) == [struct.pack("<fffH", -5.0, -10.0, -30.0, 42000)]


@pytest.mark.parametrize(
    ("thrust", "sent"), [(-1.0, 0), (0.0, 0), (59999.0, 59999), (60001.0, 60000), (math.inf, 60000)]
)
def test_thrust_is_limited(flying, thrust, sent):
    server, vehicle = flying
    server.process.publish("/cf1/cmd_vel", cmd_vel(z=thrust))
    assert vehicle.wait_for_packets(3, 0) == [struct.pack("<fffH", 0.0, -0.0, 0.0, sent)]


def test_trims_are_added_before_the_sign(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, roll_trim=1.5, pitch_trim=-0.5)
    vehicle.received.clear()
    server.process.publish("/cf1/cmd_vel", cmd_vel(x=2.0, y=3.0, z=100.0))
    assert vehicle.wait_for_packets(3, 0) == [struct.pack("<fffH", 4.5, -1.5, 0.0, 100)]


def test_full_state(flying):
    server, vehicle = flying
    message = FullState(
        pose=Pose(Point(1.0, -2.0, 0.5), Quaternion(0.0, 0.0, 0.0, 1.0)),
        twist=Twist(Vector3(0.25, 0.5, -0.75), Vector3(0.125, -0.25, 3.0)),
        acc=Vector3(0.0, 1.0, -9.75),
    )
    server.process.publish("/cf1/cmd_full_state", message)
    (data,) = vehicle.wait_for_packets(7, 0)
    assert struct.unpack("<B9hI3h", data) == (
        *(6, 1000, -2000, 500, 250, 500, -750, 0, 1000, -9750),
        *(3 << 30, 125, -250, 3000),
    )


def test_velocities_positions_and_stop(flying):
    """The bytes of the C++ driver."""
    server, vehicle = flying
    sends = [
        (
            "cmd_velocity_world",
            VelocityWorld(vel=Vector3(0.5, -0.25, 1.0), yawRate=30.0),
            struct.pack("<Bffff", 1, 0.5, -0.25, 1.0, 30.0),
        ),
        (
            "cmd_hover",
            Hover(vx=0.5, vy=-0.25, yawrate=30.0, zDistance=1.5),
            struct.pack("<Bffff", 5, 0.5, -0.25, 30.0, 1.5),
        ),
        (
            "cmd_position",
            Position(x=0.5, y=-0.25, z=1.5, yaw=90.0),
            struct.pack("<Bffff", 7, 0.5, -0.25, 1.5, 90.0),
        ),
        ("cmd_stop", EmptyMessage(), b"\0"),
    ]
    for count, (topic, message, data) in enumerate(sends, start=1):
        server.process.publish(f"/cf1/{topic}", message)
        assert vehicle.wait_for_packets(7, 0, count)[-1] == data
    server.process.advance(OVERLAP)


def test_external_poses(flying):
    server, vehicle = flying
    server.process.publish("/cf1/external_position", PointStamped(point=Point(1.0, 2.0, 3.0)))
    assert vehicle.wait_for_packets(6, 0) == [struct.pack("<fff", 1, 2, 3)]
    pose = Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 1.0, 0.0, 0.0))
    server.process.publish("/cf1/external_pose", PoseStamped(pose=pose))
    assert vehicle.wait_for_packets(6, 1) == [struct.pack("<B7f", 8, 1, 2, 3, 0, 1, 0, 0)]


def test_what_is_not_finite_is_not_sent(flying):
    server, vehicle = flying
    publish = server.process.publish
    publish("/cf1/cmd_vel", cmd_vel(x=NAN))
    publish("/cf1/cmd_vel", cmd_vel(z=NAN))
    publish("/cf1/cmd_hover", Hover(vx=NAN))
    publish("/cf1/cmd_full_state", FullState())
    publish("/cf1/external_position", PointStamped(point=Point(NAN, 0.0, 0.0)))
    publish("/cf1/external_pose", PoseStamped())
    publish("/cf1/cmd_position", Position(z=1.0))
    assert len(vehicle.wait_for_packets(7, 0)) == 1
    assert vehicle.packets(3, 0) == vehicle.packets(6, 0) == vehicle.packets(6, 1) == []
    warnings = server.process.logged("warn")
    for topic in ("cmd_vel", "cmd_hover", "cmd_full_state", "external_position", "external_pose"):
        assert sum(f"cf1: ignoring {topic}:" in text for text in warnings) == 1


def test_what_does_not_fit_in_single_precision_is_not_sent(server, vehicle, caplog):
    """Messages have float64, the link float32."""
    publish = server.process.publish
    publish("/cf1/cmd_vel", cmd_vel(x=1e39))
    publish("/cf1/cmd_velocity_world", VelocityWorld(vel=Vector3(0.0, -1e300, 0.0)))
    publish("/cf1/external_position", PointStamped(point=Point(1e39, 0.0, 0.0)))
    publish("/cf1/cmd_position", Position(z=1.0))
    assert len(vehicle.wait_for_packets(7, 0)) == 1
    assert vehicle.packets(3, 0) == vehicle.packets(6, 0) == []
    warnings = server.process.logged("warn")
    assert any("ignoring cmd_vel: attitude setpoint: 1e+39 is beyond" in text for text in warnings)
    assert "a packet could not be sent" not in caplog.text


def test_nothing_is_repeated(flying):
    server, vehicle = flying
    server.process.publish("/cf1/cmd_vel", cmd_vel(z=1.0))
    vehicle.wait_for_packets(3, 0)
    vehicle.received.clear()
    vehicle.wait_for_packets(15, 0, 5)
    assert {(port, channel) for port, channel, _ in vehicle.received} == {(15, 0)}


@pytest.mark.parametrize(
    ("info", "text"),
    [(1, "cf1: not armed, call /cf1/arm"), (1 << 6, "cf1: cannot fly (locked): restart")],
)
def test_a_vehicle_that_will_not_fly_is_pointed_out(server, info, text):
    def warned(process):
        return any(text in warning for warning in process.logged("warn"))

    vehicle = server.make_vehicle()
    vehicle.flight.pin(info)
    server.add(vehicle.uri)
    process = server.process
    assert vehicle.wait_for(lambda: warned(process), limit=0.0) is False
    for _ in range(200):
        process.publish("/cf1/cmd_vel", cmd_vel(z=1000.0))
        if vehicle.wait_for(lambda: warned(process), limit=0.05):
            break
    assert warned(process)


def test_the_rate_is_that_of_the_last_second(flying):
    server, vehicle = flying
    setpoints = server.node._vehicles[vehicle.uri].setpoints
    server.process.advance(2.0)
    for _ in range(5):
        server.process.publish("/cf1/cmd_vel", cmd_vel(z=1000.0))
        server.process.advance(0.1)
    assert setpoints.rate() == 5.0
    server.process.advance(0.75)
    assert setpoints.rate() == 2.0
    server.process.advance(1.0)
    assert setpoints.rate() == 0.0


def test_poses_that_have_ended_do_not_let_a_vehicle_land_by_itself(flying):
    server, vehicle = flying
    setpoints = server.node._vehicles[vehicle.uri].setpoints
    server.process.publish("/cf1/cmd_vel", cmd_vel(z=1000.0))
    assert not setpoints.can_land_autonomously()
    server.process.publish("/cf1/external_position", PointStamped(point=Point(1.0, 2.0, 3.0)))
    assert setpoints.can_land_autonomously()
    server.process.advance(1.1)
    assert not setpoints.can_land_autonomously()


def test_no_log_block_can_have_the_name_of_a_topic_that_is_subscribed():
    assert {CMD_VEL, CMD_STOP, *SETPOINTS, *EXTERNAL} == set(INPUT_TOPICS)
