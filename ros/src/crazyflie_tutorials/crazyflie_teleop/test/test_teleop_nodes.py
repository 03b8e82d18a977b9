"""The nodes on a fake process, and the launch files."""

import math
from concurrent.futures import Future
from pathlib import Path

import pytest
import rospkg
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Joy
from std_srvs.srv import EmptyResponse

from crazyflie_dev import launch_files
from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_teleop.circle_node import CircleNode
from crazyflie_teleop.heading_lift_lqr_node import HeadingLiftLqrNode
from crazyflie_teleop.joy_velocity_node import JoyVelocityNode
from crazyflie_teleop.takeoff_caller_node import TakeoffCallerNode
from crazyflie_teleop.velocity_reference_node import VelocityReferenceNode
from crazyflie_utils.main import NodeClasses
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import to_vector

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_teleop")) / "launch"
PARAMETERS = {"topics/reference": "/ref", "topics/controller_reference": "/ref/yaw"}
AHEAD = Twist(linear=Vector3(x=0.4))


@pytest.fixture
def process():
    fake = FakeProcess()
    assert fake.launch(VelocityReferenceNode(), "/velocity_reference", PARAMETERS)
    return fake


def refer(process, x, y, z):
    state = PositionVelocityState(x=x, y=y, z=z)
    process.publish("/ref", PositionVelocityStateStamped(state=state))


def take_off(process):
    refer(process, 0.0, 0.0, 1.0)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))


def fly(process, twist, duration):
    for _ in range(round(duration / 0.1)):
        process.publish("/cmd_vel", twist)
        process.advance(0.1)


def references(process):
    return [to_vector(message.state) for message in process.published("/ref/yaw")]


def test_references_of_others_are_passed_on(process):
    refer(process, 0.3, -0.2, 1.0)
    assert references(process)[-1].tolist() == [0.3, -0.2, 1.0, 0.0, 0.0, 0.0, 0.0]
    assert process.published("/ref/yaw")[-1].header.stamp.to_sec() == pytest.approx(100.0)


def test_flies_where_cmd_vel_says(process):
    take_off(process)
    fly(process, AHEAD, 3.0)
    last = references(process)[-1]
    # 3 s, less what speeding up with 1 m/s^2 takes.
    assert last[0] == pytest.approx(0.4 * 3.0 - 0.4**2 / 2.0, abs=0.01)
    assert last[1:] == pytest.approx([0.0, 1.0, 0.4, 0.0, 0.0, 0.0])
    assert len(references(process)) == pytest.approx(150, abs=3)


def test_stops_half_a_second_after_the_last_velocity(process):
    take_off(process)
    fly(process, AHEAD, 3.0)
    process.advance(0.39)
    assert references(process)[-1][3] == pytest.approx(0.4)
    process.advance(0.6)
    rest = references(process)[-1]
    assert rest[3:6] == pytest.approx([0.0, 0.0, 0.0])
    count = len(references(process))
    process.advance(5.0)
    assert len(references(process)) == count, "the topic is left to others"


@pytest.mark.parametrize("state", ["", "on_ground", "taking_off", "descending", "landing"])
def test_only_in_flight(process, state):
    refer(process, 0.0, 0.0, 1.0)
    if state:
        process.publish(
            "/in_flight_flight_status", FlightStatus(state=getattr(FlightStatus, state.upper()))
        )
    fly(process, AHEAD, 1.0)
    assert len(references(process)) == 1


def test_a_landing_has_the_reference_for_itself(process):
    take_off(process)
    fly(process, Twist(linear=Vector3(x=0.4), angular=Vector3(z=0.5)), 2.0)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.DESCENDING))
    yaw = references(process)[-1][6]
    count = len(references(process))
    for k in range(10):
        refer(process, 0.5, 0.1, 0.9 - 0.01 * k)
        fly(process, AHEAD, 0.1)
    assert len(references(process)) == count + 10
    # It lands as it looks: the nose does not turn back.
    assert references(process)[-1][6] == yaw == pytest.approx(1.0, abs=0.02)
    assert references(process)[-1][:3] == pytest.approx([0.5, 0.1, 0.81])


def test_after_a_reference_of_others_it_goes_on_from_there(process):
    take_off(process)
    fly(process, AHEAD, 1.0)
    refer(process, 2.0, 2.0, 1.5)
    fly(process, AHEAD, 0.1)
    assert references(process)[-1][:3] == pytest.approx([2.0, 2.0, 1.5], abs=0.05)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_velocity_that_is_not_finite_counts_as_silence(process, bad):
    take_off(process)
    fly(process, AHEAD, 2.0)
    fly(process, Twist(linear=Vector3(x=bad)), 2.0)
    assert references(process)[-1][3] == pytest.approx(0.0)
    assert "/cmd_vel: it is not finite" in process.logged("warn")[0]


def test_bad_limits_are_named():
    fake = FakeProcess()
    bad = {**PARAMETERS, "limits/min_height": 3.0}
    assert not fake.launch(VelocityReferenceNode(), "/velocity_reference", bad)
    assert "limits/min_height is 3; expected <= limits/max_height, 2 (m)" in fake.logged("error")[0]


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
@pytest.mark.parametrize("flight", ["sw_hover.launch", "virtual_hw_hover.launch"])
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
        assert classes.items() <= NodeClasses()(launch_files.composed_nodes(parameters)).items()
    assert ("/takeoff_caller" in nodes) == (file == "circle")
