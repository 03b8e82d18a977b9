"""The conversion of controls to cmd_vel, by its function and on a fake process."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from std_srvs.srv import TriggerRequest

from crazyflie_control_merger.cmd_vel_converter_node import (
    CmdVelConverterNode,
    cmd_vel_from_control,
)
from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_utils.testing import FakeProcess

values = st.floats(-10.0, 10.0)


def test_hover():
    assert cmd_vel_from_control(0.0, 0.0, 0.0, 9.81) == (
        (0.0, 0.0, pytest.approx(42000.0)),
        (0, 0, 0),
    )


def test_no_thrust_is_no_pwm():
    linear, _ = cmd_vel_from_control(0.0, 0.0, 0.0, 0.0)
    assert linear[2] == 0.0


def test_axes_and_signs():
    linear, angular = cmd_vel_from_control(0.1, 0.2, 0.5, 19.62)
    assert linear == pytest.approx((11.459156, 5.729578, 84000.0), rel=1e-6)
    assert angular == pytest.approx((0.0, 0.0, -28.647890), rel=1e-6)


@given(values, values, values, values)
def test_can_be_read_back(roll, pitch, yaw_dot, thrust):
    linear, angular = cmd_vel_from_control(roll, pitch, yaw_dot, thrust)
    assert linear[1] * math.pi / 180.0 == pytest.approx(roll)
    assert linear[0] * math.pi / 180.0 == pytest.approx(pitch)
    assert -angular[2] * math.pi / 180.0 == pytest.approx(yaw_dot)
    assert linear[2] * 9.81 / 42000.0 == pytest.approx(thrust)


PARAMETERS = {"topics/control": "/control/final", "topics/cmd_vel": "/crazyflie/cmd_vel"}


@pytest.fixture
def process():
    """Return a process with a converter in it."""
    process = FakeProcess()
    assert process.launch(CmdVelConverterNode(), "/cmd_vel_converter", PARAMETERS)
    return process


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("value", [None, "", 3, "no topic"])
def test_bad_parameters_are_named(name, value):
    process = FakeProcess()
    parameters = {**PARAMETERS, name: value}
    if value is None:
        del parameters[name]
    assert not process.launch(CmdVelConverterNode(), "/cmd_vel_converter", parameters)
    assert f"/cmd_vel_converter/{name} is" in process.logged("error")[0]


def test_converts_every_control(process):
    for k in range(1, 4):
        control = Control(roll=0.1 * k, pitch=0.2, yaw_dot=-0.3, thrust=9.81)
        process.publish("/control/final", ControlStamped(control=control))
        assert len(process.published("/crazyflie/cmd_vel")) == k
    twist = process.published("/crazyflie/cmd_vel")[-1]
    assert twist.linear.y == pytest.approx(math.degrees(0.3))
    assert twist.linear.x == pytest.approx(math.degrees(0.2))
    assert twist.angular.z == pytest.approx(math.degrees(0.3))
    assert twist.linear.z == pytest.approx(42000.0)
    assert (twist.angular.x, twist.angular.y) == (0.0, 0.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_ignored(process, bad):
    for field in Control.__slots__:
        control = ControlStamped(control=Control(**{field: bad}))
        process.publish("/control/final", control)
    assert process.published("/crazyflie/cmd_vel") == []
    [warning] = process.logged("warn")
    assert "/control/final" in warning


def test_controls_of_a_simulation_are_not_sent_to_a_vehicle():
    process = FakeProcess()
    process.transport.foreign_services["/control/final/vehicle"] = "/simulator"
    assert not process.launch(CmdVelConverterNode(), "/cmd_vel_converter", PARAMETERS)
    assert "already fly a vehicle of /simulator (process 1 on" in process.logged("error")[0]


def test_a_simulation_that_has_died_is_in_nobody_s_way():
    process = FakeProcess()
    process.transport.foreign_services["/control/final/vehicle"] = "/simulator"
    process.transport.dead_nodes.add("/simulator")
    assert process.launch(CmdVelConverterNode(), "/cmd_vel_converter", PARAMETERS)
    answer = process.call("/control/final/vehicle", TriggerRequest())
    assert answer.message == "a real vehicle, by /cmd_vel_converter"


def test_a_thrust_of_9_81_carries_the_vehicle_of_a_model(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("type: cf21_markers\nmass: 0.045\ntrim: {roll: 0.02, pitch: -0.01}\n")
    process = FakeProcess()
    parameters = {**PARAMETERS, "model": str(path)}
    assert process.launch(CmdVelConverterNode(), "/cmd_vel_converter", parameters)
    process.publish("/control/final", ControlStamped(control=Control(0.0, 0.0, 0.0, 9.81)))
    (sent,) = process.published("/crazyflie/cmd_vel")
    fraction = sent.linear.z / 65535.0
    lift = 4.0 * (0.067673604 * fraction + 0.091492681 * fraction**2)
    assert lift == pytest.approx(0.045 * 9.81)
    assert (sent.linear.y, sent.linear.x) == pytest.approx(
        (math.degrees(0.02), math.degrees(-0.01))
    )


def test_a_mass_in_grams_is_refused(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("mass: 33\n")
    process = FakeProcess()
    parameters = {**PARAMETERS, "model": str(path)}
    assert not process.launch(CmdVelConverterNode(), "/cmd_vel_converter", parameters)
    (error,) = process.logged("error")
    assert "/cmd_vel_converter/model is" in error
    assert "is 33; expected a finite number >= 0.005" in error
