"""The nodes, on a process without ROS, and their velocities."""

import math
from concurrent.futures import Future
from pathlib import Path

import pytest
import rospkg
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy
from std_srvs.srv import EmptyResponse

from crazyflie_msgs.msg import PositionVelocityYawState, PositionVelocityYawStateStamped
from crazyflie_references.velocity_reference import Velocity
from crazyflie_references.velocity_reference_node import VelocityReferenceNode
from crazyflie_teleop.nodes import (
    CircleNode,
    HeadingLiftLqrNode,
    JoyVelocityNode,
    TakeoffCallerNode,
    circle_velocity,
)
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeProcess, launch_files


def test_turns_by_speed_over_radius():
    assert circle_velocity(0.5, 0.3, clockwise=True) == Velocity(x=0.3, yaw_dot=-0.6)
    assert circle_velocity(0.5, 0.3, clockwise=False) == Velocity(x=0.3, yaw_dot=0.6)


LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_teleop")) / "launch"


def test_the_controller_follows_the_heading_of_its_reference():
    _, parameters = launch_files.expand(LAUNCH / "velocity.launch", rviz="false")
    fake = FakeProcess(parameters)
    assert fake.launch(HeadingLiftLqrNode(), "/lqr_controller")
    reference = PositionVelocityYawState(x=0.1, yaw=1.0)
    topic = "/ref/position_velocity_yaw"
    for yaw in (0.5, 1.0, 1.5):
        fake.publish(topic, PositionVelocityYawStateStamped(state=reference))
        state = PositionVelocityYawState(yaw=yaw)
        fake.publish("/state", PositionVelocityYawStateStamped(state=state))
    controls = [message.control for message in fake.published("/control/lqr")]
    assert controls[0].yaw_dot > 0.0 == controls[1].yaw_dot > controls[2].yaw_dot
    # Ahead of it and to its right, as it looks now: at 90 degrees it would be to the right only.
    assert controls[0].pitch > controls[1].pitch > controls[2].pitch > 0.0
    assert 0.0 < controls[0].roll < controls[1].roll < controls[2].roll


def test_circle_says_the_same_over_and_over_and_stops_at_the_end():
    fake = FakeProcess()
    node = CircleNode()
    assert fake.launch(node, "/circle", {"radius": 0.6, "speed": 0.3})
    fake.advance(1.0)
    said = fake.published("/cmd_vel")
    assert len(said) == 10
    assert all((m.linear.x, m.angular.z) == (0.3, -0.5) for m in said)
    fake.shut_down({"/circle": node})
    assert fake.published("/cmd_vel")[-1] == Twist()


def test_joystick_to_velocities_and_services():
    fake = FakeProcess()
    calls = []
    for name in ("takeoff", "land", "emergency"):
        fake.transport.services[f"/{name}"] = lambda _, name=name: answer(calls, name)
    node = JoyVelocityNode()
    assert fake.launch(node, "/joy_velocity", {"srv/emergency": "/emergency"})
    fake.publish("/joy", Joy(axes=[0.5, 1.0, 0.0, -1.0, 0.5], buttons=[0, 0, 1]))
    twist = fake.published("/cmd_vel")[-1]
    assert (twist.linear.x, twist.linear.y, twist.linear.z) == pytest.approx((0.25, -0.5, 0.3))
    assert twist.angular.z == pytest.approx(0.5)
    # Held, let go and pressed again: two calls.
    for buttons in ([0, 0, 1], [0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0]):
        fake.publish("/joy", Joy(buttons=buttons))
    assert calls == ["takeoff", "takeoff", "land", "emergency"]
    assert fake.published("/cmd_vel")[-1] == Twist()
    count = len(fake.published("/cmd_vel"))
    fake.publish("/joy", Joy(axes=[math.nan]))
    fake.advance(5.0)
    assert len(fake.published("/cmd_vel")) == count


def test_emergency_without_a_service_lands():
    fake = FakeProcess()
    calls = []
    fake.transport.services["/land"] = lambda _: answer(calls, "land")
    assert fake.launch(JoyVelocityNode(), "/joy_velocity")
    fake.publish("/joy", Joy(buttons=[0, 1, 0]))
    assert calls == ["land"]


def answer(calls, name):
    calls.append(name)
    future = Future()
    future.set_result(EmptyResponse())
    return future


def test_takeoff_is_called_once_when_it_is_there():
    fake = FakeProcess()
    calls = []
    assert fake.launch(TakeoffCallerNode(), "/takeoff_caller")
    fake.advance(3.0)
    fake.transport.services["/takeoff"] = lambda _: answer(calls, "takeoff")
    fake.advance(3.0)
    assert calls == ["takeoff"]


@pytest.mark.parametrize("composed", ["false", "true"])
@pytest.mark.parametrize("file", ["velocity", "circle", "teleop"])
@pytest.mark.parametrize(
    "flight", ["sw_hover.launch", "sw_obstacles.launch", "virtual_hw_hover.launch"]
)
def test_launch_files(file, flight, composed):
    nodes, parameters = launch_files.expand(
        LAUNCH / f"{file}.launch", flight=flight, composed=composed, rviz="false"
    )
    classes = {
        "velocity_reference": VelocityReferenceNode,
        "lqr_controller": HeadingLiftLqrNode,
    }
    classes |= {"circle": {"circle": CircleNode}, "teleop": {"joy_velocity": JoyVelocityNode}}.get(
        file, {}
    )
    fake = FakeProcess(parameters)
    for name, node in classes.items():
        assert (f"/{name}" in nodes) == (composed == "false")
        assert fake.launch(node(), f"/{name}"), fake.logged("error")
    assert parameters["/lqr_controller/topics/reference"] == "/ref/position_velocity_yaw"
    if composed == "true":
        assert classes.items() <= NODE_CLASSES(launch_files.composed_nodes(parameters)).items()
    assert ("/takeoff_caller" in nodes) == (file == "circle")
