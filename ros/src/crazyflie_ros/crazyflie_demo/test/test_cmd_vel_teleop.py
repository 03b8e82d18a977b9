"""Flight by hand: sticks to cmd_vel."""

import pytest
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from crazyflie_demo.node_parts import REPEATED
from crazyflie_demo.teleop_nodes import CmdVelTeleopNode, QuadrotorTeleopNode
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess

NAN = float("nan")
PITCH, ROLL, YAW, THRUST = 4, 3, 0, 1


SDK = {
    **{"x_axis": 5, "y_axis": 4, "z_axis": 2, "yaw_axis": 1},
    **{"x_velocity_max": 30, "y_velocity_max": -30},
    **{"z_velocity_max": 60000, "yaw_velocity_max": -200},
}
"""As xbox360.launch of the SDK sets them for quadrotor_teleop."""


def launch(node_class=CmdVelTeleopNode, **parameters):
    process = FakeProcess()
    assert process.launch(node_class(), "/cf/teleop", parameters)
    return process


def tilt(process, count=8, frame_id=REPEATED, **sticks):
    """Send the joystick's axes, and wait for the setpoint."""
    axes = [0.0] * count
    for name, value in sticks.items():
        axes[{"pitch": PITCH, "roll": ROLL, "yaw": YAW, "thrust": THRUST}[name]] = value
    process.publish("/cf/joy", Joy(Header(frame_id=frame_id), axes, []))
    process.advance(0.02)


def last(process):
    """Return the last setpoint: pitch, roll, thrust, yaw rate."""
    twist = process.published("/cf/cmd_vel")[-1]
    assert (twist.angular.x, twist.angular.y) == (0.0, 0.0)
    return (*(getattr(twist.linear, axis) for axis in "xyz"), twist.angular.z)


def test_is_silent_without_a_joystick():
    process = launch()
    process.advance(1.0)
    assert process.published("/cf/cmd_vel") == []


@pytest.mark.parametrize(
    ("sticks", "setpoint"),
    [
        ({}, (0.0, 0.0, 0.0, 0.0)),
        ({"pitch": 1.0}, (30.0, 0.0, 0.0, 0.0)),
        ({"pitch": -0.5}, (-15.0, 0.0, 0.0, 0.0)),
        # A stick to the left: roll to the left is negative, turning to the left as well.
        ({"roll": 1.0}, (0.0, -30.0, 0.0, 0.0)),
        ({"yaw": 1.0}, (0.0, 0.0, 0.0, -200.0)),
        ({"thrust": 0.5}, (0.0, 0.0, 30000.0, 0.0)),
        ({"thrust": -1.0}, (0.0, 0.0, 0.0, 0.0)),
        ({"thrust": 9.0, "roll": -9.0}, (0.0, 30.0, 60000.0, 0.0)),
        ({"pitch": NAN}, (0.0, 0.0, 0.0, 0.0)),
    ],
)
@pytest.mark.parametrize(
    ("node_class", "parameters"), [(CmdVelTeleopNode, {}), (QuadrotorTeleopNode, SDK)]
)
def test_sticks_become_setpoints(node_class, parameters, sticks, setpoint):
    process = launch(node_class, **parameters)
    tilt(process)
    tilt(process, **sticks)
    assert last(process) == pytest.approx(setpoint)


def test_axes_and_ranges_can_be_chosen():
    process = launch(
        **{"axes/thrust": 2, "max/thrust": 50000.0, "axes/yaw_rate": 1, "max/yaw_rate": 90.0}
    )
    tilt(process)
    process.publish("/cf/joy", Joy(axes=[0.0, -1.0, 1.0]))
    process.advance(0.02)
    assert last(process) == (0.0, 0.0, 50000.0, 90.0)


def test_a_negative_axis_is_inverted_and_axis_0_is_no_axis():
    process = launch(QuadrotorTeleopNode, **{**SDK, "x_axis": -5, "yaw_axis": 0, "z_axis": -2})
    tilt(process)
    tilt(process, pitch=1.0, roll=0.5, yaw=1.0, thrust=-0.5)
    assert last(process) == pytest.approx((-30.0, -15.0, 30000.0, 0.0))


def test_thrust_counts_after_its_stick_has_been_at_zero():
    process = launch()
    tilt(process, thrust=0.7, pitch=0.1)
    assert last(process) == pytest.approx((3.0, 0.0, 0.0, 0.0))
    tilt(process, thrust=0.0)
    tilt(process, thrust=0.7)
    assert last(process)[2] == pytest.approx(42000.0)


def test_falls_silent_with_the_joystick_and_locks_the_thrust():
    process = launch()
    tilt(process)
    tilt(process, thrust=0.7)
    process.advance(1.0)
    count = len(process.published("/cf/cmd_vel"))
    assert count == pytest.approx(27, abs=2)
    assert "no joystick on joy" in process.logged("warn")[0]
    process.advance(1.0)
    assert len(process.published("/cf/cmd_vel")) == count
    assert len(process.logged("warn")) == 1
    tilt(process, thrust=0.7)
    assert last(process)[2] == 0.0


def test_a_joystick_that_only_tells_changes_may_be_held_still():
    process = launch()
    tilt(process, frame_id="")
    tilt(process, frame_id="", thrust=0.7)
    process.advance(10.0)
    assert len(process.published("/cf/cmd_vel")) == 502
    assert last(process)[2] == pytest.approx(42000.0)
    # Its node dies, and another one comes: what the first one said does not count any more.
    process.transport.unpublished.add("/cf/joy")
    process.advance(1.0)
    process.transport.unpublished.clear()
    process.advance(1.0)
    assert len(process.published("/cf/cmd_vel")) == 502
    assert "no joystick on joy" in process.logged("warn")[0]
    tilt(process, frame_id="", thrust=0.7)
    assert last(process)[2] == 0.0


@pytest.mark.parametrize(
    "parameters",
    [{"axes/pitch": -1}, {"max/thrust": 70000.0}, {"max/roll": 0.0}, {"rate": 0.0}],
)
def test_a_bad_parameter_is_named(parameters):
    process = FakeProcess()
    assert not process.launch(CmdVelTeleopNode(), "/teleop", parameters)
    assert next(iter(parameters)) in process.logged("error")[0]


def test_the_largest_tilt_may_be_changed_in_flight():
    process = launch()
    tilt(process)
    process.reconfigure("/cf/teleop", **{"max/pitch": 10.0})
    tilt(process, pitch=1.0)
    assert last(process)[0] == 10.0


def test_a_bad_change_is_refused():
    process = launch()
    tilt(process)
    with pytest.raises(ServiceError, match="/cf/teleop/max/pitch is 90.0; expected"):
        process.reconfigure("/cf/teleop", **{"max/pitch": 90.0})
    tilt(process, pitch=1.0)
    assert last(process)[0] == 30.0
