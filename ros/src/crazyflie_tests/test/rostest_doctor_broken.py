"""The doctor names what is wrong in a graph that was broken on purpose."""

import contextlib
import socket

import pytest
import rosgraph
import rospy
from doctor_runs import about, run_doctor
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils.testing.peer import wait_until


class OldControlStamped(ControlStamped):
    """As a workspace of another age has it."""

    _md5sum = "0" * 32


@pytest.fixture(scope="module")
def lines():
    """Return what the doctor prints."""
    with contextlib.ExitStack() as stack:
        # Controller and reference of another workspace, and frames in a loop.
        publishers = [
            rospy.Publisher("/control/lqr", OldControlStamped, queue_size=1),
            rospy.Publisher("/tf", TFMessage, queue_size=10),
            rospy.Publisher("/ref", OldControlStamped, queue_size=1),
        ]
        for publisher in publishers:
            stack.callback(publisher.unregister)
        # A node that accepts connections and never answers, and one that is no more.
        frozen = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        for name, port in (("/frozen", frozen.getsockname()[1]), ("/dead", 1)):
            uri = f"http://127.0.0.1:{port}"
            rosgraph.Master(name).registerPublisher(f"{name}/topic", "std_msgs/Empty", uri)
        # One node may publish references in addition to the takeoff server, not two.
        rosgraph.Master("/dead").registerPublisher(
            "/ref", ControlStamped._type, "http://127.0.0.1:1"
        )
        rospy.set_param("/cf1/add/uri", "radio://0/80/2M/E7E7E7E7E7")
        rospy.set_param("/cf2/add/uri", "radio://0/80/2M/E7E7E7E7E7")
        rospy.set_param("/use_sim_time", True)
        timer = rospy.Timer(rospy.Duration(0.1), lambda now: publishers[1].publish(_loop(now)))
        stack.callback(timer.shutdown)
        wait_until(lambda: publishers[1].get_num_connections() > 0, "a listener to tf")
        status, printed = run_doctor(may_warn=True)
    assert status == 1
    return printed


def _loop(now):
    message = TFMessage()
    for parent, child in (("egg", "hen"), ("hen", "egg")):
        transform = TransformStamped(child_frame_id=child)
        transform.header.frame_id = parent
        transform.header.stamp = now.current_real
        transform.transform.rotation.w = 1.0
        message.transforms.append(transform)
    return message


@pytest.mark.parametrize(
    ("check", "part"),
    [
        ("nodes", "/frozen does not answer (timed out)"),
        ("nodes", "/dead does not answer ([Errno 111] Connection refused)"),
        ("types", "publishes /control/lqr as crazyflie_msgs/ControlStamped with MD5 000000"),
        ("types", "/ref has publishers of crazyflie_msgs/ControlStamped, crazyflie_msgs/Pos"),
        ("connections", "/composed is not connected to /doctor_broken"),
        ("publishers", "/control/takeof has no publisher, /composed waits for it"),
        ("publishers", "/control/lqr comes from /composed, /doctor_broken"),
        ("publishers", "the reference /ref comes from /dead, /doctor_broken"),
        ("clock", "/use_sim_time is true, but nothing comes on /clock"),
        ("tf tree", "crazyflie/base_link has the parents crazyflie, world"),
        ("tf tree", "tf has a loop: egg -> hen -> egg"),
        (
            "frames",
            "no node publishes the frame crazyfly that /state_estimator needs (did",
        ),
        ("drivers", "radio://0/80/2M/E7E7E7E7E7 is added by /cf1/add, /cf2/add"),
        ("Crazyradio", "no Crazyradio is plugged in for radio://0/80/2M/E7E7E7E7E7"),
    ],
)
def test_is_found(lines, check, part):
    assert part in about(check, lines), "\n".join(lines)
    assert about(check, lines).startswith(("error ", "warn "))
