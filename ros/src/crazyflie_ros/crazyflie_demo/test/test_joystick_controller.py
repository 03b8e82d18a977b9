"""Buttons that call services."""

import threading

import pytest
from fake_driver import FakeDriver
from sensor_msgs.msg import Joy

from crazyflie_demo.teleop_nodes import JoystickControllerNode
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.testing.programs import wait_until


def launch(has_controller=True, parameters=None):
    process = FakeProcess()
    process.transport.parameters.update(parameters or {})
    process.driver = FakeDriver()
    assert process.launch(process.driver, "/driver")
    settings = {"use_crazyflie_controller": has_controller}
    assert process.launch(JoystickControllerNode(), "/cf/joystick_controller", settings)
    return process


def hold(process, *buttons):
    process.publish("/cf/joy", Joy(buttons=[int(i in buttons) for i in range(11)]))


@pytest.mark.parametrize(("button", "service"), [(0, "land"), (1, "emergency"), (2, "takeoff")])
def test_a_press_is_one_call(button, service):
    process = launch()
    hold(process)
    for _ in range(5):
        hold(process, button)
    assert process.driver.names() == [service]
    hold(process)
    assert process.driver.names() == [service]
    hold(process, button)
    assert process.driver.names() == [service] * 2


def test_the_first_message_may_be_a_press():
    process = launch()
    hold(process, 1)
    assert process.driver.names() == ["emergency"]


def test_without_a_controller_nothing_takes_off():
    process = launch(has_controller=False)
    hold(process, 0, 1, 2)
    assert process.driver.names() == ["emergency"]


@pytest.mark.parametrize("parameters", [{}, {"/cf/ring/headlightEnable": 0}])
def test_the_headlight_goes_on_and_off(parameters):
    process = launch(parameters=parameters)
    for count, value in enumerate((1, 0, 1), start=1):
        hold(process, 4)
        hold(process)
        wait_until(lambda count=count: len(process.driver.calls) == count, "the call")
        assert process.transport.parameters["/cf/ring/headlightEnable"] == value
    requests = [request for _, name, request in process.driver.calls if name == "update_params"]
    assert [request.params for request in requests] == [["ring/headlightEnable"]] * 3


@pytest.mark.parametrize("operation", ["get_param", "set_param"])
def test_a_frozen_master_blocks_no_other_button(operation, monkeypatch):
    process = launch()
    answers, answer = threading.Event(), getattr(process.transport, operation)
    delayed = lambda *arguments: answers.wait(5.0) and answer(*arguments)  # noqa: E731
    monkeypatch.setattr(process.transport, operation, delayed)
    hold(process, 4)
    hold(process, 4, 1)
    assert process.driver.names() == ["emergency"]
    answers.set()
    wait_until(lambda: process.driver.names() == ["emergency", "update_params"], "the headlight")


def test_a_refusal_is_reported_and_the_buttons_go_on_working():
    process = launch()
    process.driver.refused = {"takeoff": "land first"}
    hold(process, 2)
    assert "/cf/takeoff failed: land first" in process.logged("error")[0]
    hold(process, 1)
    assert process.driver.names()[-1] == "emergency"


def test_other_buttons_and_joysticks_with_few_do_nothing():
    process = launch()
    process.publish("/cf/joy", Joy(buttons=[]))
    hold(process, 3, 5, 6, 7, 8, 9, 10)
    process.publish("/cf/joy", Joy(buttons=[0]))
    assert process.driver.calls == []
