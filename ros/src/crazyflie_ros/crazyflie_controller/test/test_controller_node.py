"""The controller as a node, on a fake process."""

import math

import pytest
from closed_loop import control_from_cmd_vel, parameters
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    TransformStamped,
    Twist,
    Vector3,
)
from std_msgs.msg import String
from std_srvs.srv import EmptyRequest
from tf2_msgs.msg import TFMessage

from crazyflie_controller.controller_node import ControllerNode
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_msgs.msg import ControlStamped
from crazyflie_simulator.quadrotor_simulator_node import QuadrotorSimulatorNode
from crazyflie_utils import Node, ServiceError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import from_vector

NAN = float("nan")


def launch(node=None, **changes):
    process = FakeProcess()
    settings = {"frame": "cf", **parameters(), **changes}
    assert process.launch(node or ControllerNode(), "/crazyflie/controller", settings)
    return process


def show(process, x=0.0, y=0.0, z=0.0, yaw=0.0, frame="cf"):
    """Tell tf a pose that is measured now."""
    transform = TransformStamped()
    transform.header.stamp = process.clock.stamp()
    transform.header.frame_id = "world"
    transform.child_frame_id = frame
    transform.transform.translation = Vector3(x, y, z)
    transform.transform.rotation = Quaternion(*quaternion_from_rpy(0.0, 0.0, yaw))
    process.publish("/tf", TFMessage([transform]))
    process.advance(0.02)


def goal(x=0.0, y=0.0, z=0.0, quaternion=(0.0, 0.0, 0.0, 1.0), frame="world"):
    message = PoseStamped(pose=Pose(Point(x, y, z), Quaternion(*quaternion)))
    message.header.frame_id = frame
    return message


def call(process, service):
    return process.call(f"/crazyflie/{service}", EmptyRequest())


def last(process):
    """Return the last cmd_vel: pitch, roll, thrust, yaw rate."""
    twist = process.published("/crazyflie/cmd_vel")[-1]
    assert (twist.angular.x, twist.angular.y) == (0.0, 0.0)
    return (*(getattr(twist.linear, axis) for axis in "xyz"), twist.angular.z)


def fly(process):
    """Lift off and arrive above the start."""
    show(process)
    call(process, "takeoff")
    show(process)
    show(process, z=0.1)
    assert process.logged("info")[-1] == "/crazyflie/controller: automatic"


def test_without_anything_it_gives_no_thrust_at_its_frequency():
    process = launch(frequency=20.0)
    process.advance(1.0)
    assert process.published("/crazyflie/cmd_vel") == [Twist()] * 20


def test_lands_before_its_process_ends():
    node = ControllerNode()
    process = launch(node)
    show(process)
    node.prepare_shutdown()
    assert not process.published("/flights")
    call(process, "takeoff")
    show(process)
    assert process.published("/flights")[-1].data == "/crazyflie/controller in flight"
    show(process, z=0.1)
    node.prepare_shutdown()
    # The descent, whose end it sees, and the thrust that fades for a second.
    for _ in range(60):
        show(process)
    assert process.logged("info")[-1] == "/crazyflie/controller: idle"
    assert last(process) == (0.0, 0.0, 0.0, 0.0)
    assert process.published("/flights")[-1].data == "/crazyflie/controller on ground"


def test_lands_before_a_node_that_it_needs_ends():
    process = launch()
    show(process)
    call(process, "takeoff")
    show(process)
    show(process, z=0.1)
    process.publish("/flights", String("/crazyflie_server is to end: land"))
    for _ in range(60):
        show(process)
    assert process.logged("info")[-1] == "/crazyflie/controller: idle"
    assert last(process) == (0.0, 0.0, 0.0, 0.0)


def test_does_not_take_off_when_its_process_is_to_end():
    process = launch()
    show(process)
    process.prepare_shutdown({})
    with pytest.raises(ServiceError, match="takeoff refused: /crazyflie/controller is to end"):
        call(process, "takeoff")


def test_steers_to_the_goal():
    process = launch()
    process.publish("/crazyflie/goal", goal(0.1, 0.2, 0.1, quaternion_from_rpy(0.0, 0.0, 0.3)))
    fly(process)
    pitch, roll, _, yaw_rate = last(process)
    assert (pitch, roll) == pytest.approx((4.0, -8.0))
    assert yaw_rate == pytest.approx(-60.0)


def test_a_goal_is_seen_from_the_heading_of_the_vehicle():
    process = launch()
    process.publish("/crazyflie/goal", goal(0.1, 0.0, 0.1, quaternion_from_rpy(0, 0, math.pi / 2)))
    show(process, yaw=math.pi / 2)
    call(process, "takeoff")
    show(process, yaw=math.pi / 2)
    show(process, yaw=math.pi / 2, z=0.1)
    # For a vehicle that faces north, east is to the right.
    assert last(process) == pytest.approx((0.0, 4.0, last(process)[2], 0.0), abs=1e-6)


@pytest.mark.parametrize(
    ("bad", "word"),
    [
        (goal(x=NAN), "not finite"),
        (goal(z=math.inf), "not finite"),
        (goal(quaternion=(0.0, NAN, 0.0, 1.0)), "not finite"),
        (goal(x=9.0, quaternion=(0.0, 0.0, 0.0, 0.0)), "(0, 0, 0, 0)"),
    ],
)
def test_a_bad_goal_is_ignored(bad, word):
    process = launch()
    process.publish("/crazyflie/goal", goal(0.1, 0.0, 0.1))
    process.publish("/crazyflie/goal", bad)
    (warning,) = process.logged("warn")
    assert word in warning
    fly(process)
    assert last(process)[0] == pytest.approx(4.0)


def test_a_goal_in_another_frame_is_reported():
    process = launch()
    process.publish("/crazyflie/goal", goal(frame="/world"))
    process.publish("/crazyflie/goal", goal(frame=""))
    assert not process.logged("warn")
    process.publish("/crazyflie/goal", goal(frame="map"))
    assert "map" in process.logged("warn")[0]


def test_says_which_frames_tf_does_not_know():
    process = launch(worldFrame="/lab", frame="/vicon/cf1/cf1")
    process.advance(0.1)
    (warning,) = process.logged("warn")
    assert "vicon/cf1/cf1" in warning
    assert "lab" in warning
    with pytest.raises(ServiceError, match="/crazyflie/takeoff refused: .*no new pose"):
        call(process, "takeoff")


def test_refuses_what_makes_no_sense():
    process = launch()
    with pytest.raises(ServiceError, match="/crazyflie/land refused: .*idle"):
        call(process, "land")
    fly(process)
    with pytest.raises(ServiceError, match="/crazyflie/takeoff refused: .*land first"):
        call(process, "takeoff")


def test_falls_silent_without_poses_with_a_warning():
    process = launch()
    fly(process)
    process.advance(0.6)
    count = len(process.published("/crazyflie/cmd_vel"))
    process.advance(1.0)
    assert len(process.published("/crazyflie/cmd_vel")) == count
    assert any("sending no setpoints" in text for text in process.logged("warn"))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"frame": ""}, "/crazyflie/controller/frame"),
        ({"frequency": 0}, "frequency"),
        ({"PIDs/X/kp": "high"}, "PIDs/X/kp"),
        ({"PIDs/Z/minOutput": 70000.0}, "PIDs/Z/minOutput is 70000; expected at most maxOutput"),
        ({"PIDs/Yaw/integratorMin": 1.0}, "PIDs/Yaw/integratorMin is 1"),
    ],
)
def test_a_bad_parameter_is_named(changes, reason):
    process = FakeProcess()
    settings = {"frame": "cf", **parameters(), **changes}
    assert not process.launch(ControllerNode(), "/crazyflie/controller", settings)
    assert reason in process.logged("error")[0]


def test_a_gain_may_be_changed_in_flight_without_a_jump_of_the_thrust():
    process = launch()
    process.publish("/crazyflie/goal", goal(0.1, 0.0, 0.1))
    fly(process)
    pitch, _, thrust, _ = last(process)
    assert pitch == pytest.approx(4.0)
    process.reconfigure("/crazyflie/controller", **{"PIDs/X/kp": 20.0, "PIDs/Z/ki": 7000.0})
    show(process, z=0.1)
    assert last(process)[0] == pytest.approx(2.0, abs=0.01)
    # The vehicle no longer climbs: what was taken off for that comes back.
    assert last(process)[2] == pytest.approx(thrust, abs=1.0)


def test_a_bad_change_is_refused():
    process = launch()
    process.publish("/crazyflie/goal", goal(0.1, 0.0, 0.1))
    fly(process)
    with pytest.raises(ServiceError, match="PIDs/X/minOutput is 20; expected at most maxOutput"):
        process.reconfigure("/crazyflie/controller", **{"PIDs/X/minOutput": 20.0})
    with pytest.raises(ServiceError, match="frame cannot be changed"):
        process.reconfigure("/crazyflie/controller", frame="other")
    show(process, z=0.1)
    assert last(process)[0] == pytest.approx(4.0, abs=0.01)


def test_every_gain_is_required():
    for missing in parameters():
        process = FakeProcess()
        settings = {"frame": "cf", **parameters()}
        del settings[missing]
        assert not process.launch(ControllerNode(), "/controller", settings)
        assert missing in process.logged("error")[0]


class Radio(Node):
    """Hands cmd_vel to the simulator, as the driver does to a vehicle."""

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self._publisher = handle.publisher("/control", ControlStamped)
        handle.subscribe("/crazyflie/cmd_vel", Twist, self._on_cmd_vel)

    def _on_cmd_vel(self, twist):
        control = control_from_cmd_vel(
            twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.z
        )
        message = ControlStamped()
        message.control = from_vector(type(message.control), control)
        self._publisher.publish(message)


def test_flies_a_simulated_quadrotor():
    process = launch()
    assert process.launch(Radio(), "/radio")
    simulator = {
        "time_step": 0.01,
        **{f"init/{axis}": 0.0 for axis in "xyz"},
        "frames/fixed": "world",
        "frames/robot": "cf",
        "topics/control": "/control",
        "mass_error": 0.05,
    }
    assert process.launch(QuadrotorSimulatorNode(), "/simulator", simulator)
    process.publish("/crazyflie/goal", goal(0.5, -0.5, 1.0, quaternion_from_rpy(0.0, 0.0, 0.4)))
    process.advance(0.1)
    call(process, "takeoff")
    process.advance(25.0)
    lookup = process.transforms.lookup
    pose = lookup("world", "cf").transform.translation
    assert (pose.x, pose.y, pose.z) == pytest.approx((0.5, -0.5, 1.0), abs=0.05)
    call(process, "land")
    process.advance(6.0)
    assert process.logged("info")[-1] == "/crazyflie/controller: idle"
    pose = lookup("world", "cf").transform.translation
    assert (pose.x, pose.y, pose.z) == pytest.approx((0.5, -0.5, 0.0), abs=0.05)
