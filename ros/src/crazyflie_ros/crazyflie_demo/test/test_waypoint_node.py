"""The waypoint demo as a node."""

import pytest
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from crazyflie_demo.waypoint_node import Demo2Node, DemoNode
from crazyflie_model.angles import quaternion_from_rpy, rpy_from_quaternion
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess


def launch(node, **parameters):
    process = FakeProcess()
    assert process.launch(node, "/cf/demo", {"frame": "cf", **parameters})
    return process


def goal(process):
    pose = process.published("/cf/goal")[-1].pose
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, rpy_from_quaternion(q.x, q.y, q.z, q.w)[2])


def fly_to(process, x, y, z, yaw):
    transform = TransformStamped()
    transform.header.stamp = process.clock.stamp()
    transform.header.frame_id, transform.child_frame_id = "world", "cf"
    transform.transform.translation = Vector3(x, y, z)
    transform.transform.rotation = Quaternion(*quaternion_from_rpy(0.0, 0.0, yaw))
    process.publish("/tf", TFMessage([transform]))
    process.advance(0.1)


def test_leads_a_vehicle_along_the_waypoints():
    process = launch(Demo2Node(), worldFrame="/world")
    process.advance(0.1)
    visited = []
    for waypoint in Demo2Node.waypoints:
        assert goal(process) == pytest.approx(waypoint[:4])
        visited.append(goal(process))
        fly_to(process, *waypoint[:4])
        process.advance(waypoint.seconds)
        fly_to(process, *waypoint[:4])
    assert len(visited) == len(Demo2Node.waypoints)
    assert "finished" in process.logged("info")[-1]
    assert goal(process) == pytest.approx(Demo2Node.waypoints[-1][:4])


def test_other_waypoints_can_be_given():
    process = launch(DemoNode(), waypoints=[[1, 2, 1, 0.5, 0], [3, 2, 1, 0, 0]])
    process.advance(0.1)
    assert goal(process) == pytest.approx((1.0, 2.0, 1.0, 0.5))
    fly_to(process, 1.0, 2.0, 1.0, 0.5)
    assert goal(process) == pytest.approx((3.0, 2.0, 1.0, 0.0))


def test_an_old_pose_reaches_no_waypoint():
    process = launch(DemoNode(), waypoints=[[0, 0, 1, 0, 5.0], [1, 0, 1, 0, 0]])
    fly_to(process, 0.0, 0.0, 1.0, 0.0)
    process.advance(20.0)
    assert goal(process)[0] == 0.0
    fly_to(process, 0.0, 0.0, 1.0, 0.0)
    assert goal(process)[0] == 1.0


def test_says_which_frames_tf_does_not_know():
    process = launch(DemoNode(), frame="/vicon/cf1/cf1")
    process.advance(1.0)
    (warning,) = process.logged("warn")
    assert "no pose of vicon/cf1/cf1 in world" in warning


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"frame": ""}, "/cf/demo/frame"),
        ({"waypoints": [[0, 0, 1]]}, "/cf/demo/waypoints is [[0, 0, 1]]; expected a list"),
        ({"waypoints": [[0, 0, 1]]}, "(waypoint 0 is [0, 0, 1])"),
        ({"tolerance/position": 0.0}, "tolerance/position"),
    ],
)
def test_a_bad_parameter_is_named(changes, reason):
    process = FakeProcess()
    assert not process.launch(DemoNode(), "/cf/demo", {"frame": "cf", **changes})
    assert reason in process.logged("error")[0]


def test_the_tolerance_may_be_changed_in_flight():
    process = launch(DemoNode(), waypoints=[[0, 0, 1, 0, 0], [1, 0, 1, 0, 0]])
    fly_to(process, 0.4, 0.0, 1.0, 0.0)
    assert goal(process)[0] == 0.0
    with pytest.raises(ServiceError, match="/cf/demo/tolerance/position is 0.0; expected"):
        process.reconfigure("/cf/demo", **{"tolerance/position": 0.0})
    process.reconfigure("/cf/demo", **{"tolerance/position": 0.5})
    fly_to(process, 0.4, 0.0, 1.0, 0.0)
    assert goal(process)[0] == 1.0
