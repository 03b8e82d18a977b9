"""A virtual vehicle is flown by hand: by a joystick that is replayed, and by keys."""

import os
import pty
import signal
import termios
import time

import rospy
from flights import LIMIT, Observer, Stick, launched, virtual_vehicle, wait_for_service
from sensor_msgs.msg import Joy

from crazyflie_demo.joystick import EMERGENCY, HEADLIGHT, PITCH, ROLL, TAKEOFF, THRUST, YAW
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_utils.testing.peer import listening, wait_until
from crazyflie_utils.testing.programs import running

CLIMB, HOVER = 0.78, 0.7
"""Of the thrust stick's way; 60000 PWM at the end, and a dead zone at the beginning."""


def heading(truth):
    return rpy_from_quaternion(*truth.quaternion)[2]


def headlight():
    return rospy.get_param("/crazyflie/ring/headlightEnable", None)


def test_a_joystick(tmp_path):
    with (
        Observer() as observer,
        Stick(tmp_path / "js0") as stick,
        virtual_vehicle(**{"observer/port": observer.port}) as uri,
        launched("crazyflie_demo", "teleop_xbox360.launch", uri=uri, joy_dev=tmp_path / "js0"),
    ):
        wait_for_service("/crazyflie/emergency")
        wait_until(lambda: headlight() == 0, "the driver")
        stick.press(HEADLIGHT)
        wait_until(lambda: headlight() == 1, "the headlight")

        stick.tilt(THRUST, 0.0)
        rospy.wait_for_message("/crazyflie/cmd_vel", rospy.AnyMsg, LIMIT)
        stick.tilt(THRUST, CLIMB)
        observer.track_until(lambda truth: truth.position[2] > 0.5)
        stick.tilt(THRUST, HOVER)

        stick.tilt(PITCH, 0.4)
        observer.track_until(lambda truth: truth.velocity[0] > 0.5)
        stick.tilt(PITCH, 0.0)
        stick.tilt(ROLL, 0.4)
        observer.track_until(lambda truth: truth.velocity[1] > 0.5)
        stick.tilt(ROLL, 0.0)
        stick.tilt(YAW, 0.5)
        observer.track_until(lambda truth: heading(truth) > 0.4)
        stick.tilt(YAW, 0.0)

        stick.press(EMERGENCY)
        observer.track_until(lambda truth: truth.position[2] < 0.02)
        # The sticks have no effect any more.
        stick.tilt(THRUST, 1.0)
        end = time.monotonic() + 1.0
        track = observer.track_until(lambda truth: time.monotonic() > end)
        assert max(truth.position[2] for truth in track) < 0.1


def test_a_keyboard_and_its_terminal():
    keys, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)
    command = ["rosrun", "crazyflie_demo", "keyboard_teleop.py", "__ns:=crazyflie"]
    with running(*command, stdin=terminal) as keyboard:
        first = rospy.wait_for_message("/crazyflie/joy", Joy, LIMIT)
        assert not any(first.buttons)
        assert termios.tcgetattr(terminal) != before
        with listening("/crazyflie/joy", Joy) as heard:
            heard.next()
            os.write(keys, b"t\x1b[A")
            heard.next(lambda message: message.buttons[TAKEOFF])
            heard.next(lambda message: message.axes[PITCH] > 0.0)
        keyboard.send_signal(signal.SIGINT)
        assert keyboard.wait(LIMIT) == 0
    assert termios.tcgetattr(terminal) == before
    os.close(keys)
    os.close(terminal)
