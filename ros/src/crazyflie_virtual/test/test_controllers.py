"""PID and the signs of the cascade."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_model.inner_loops import Gains
from crazyflie_model.units import GRAVITY
from crazyflie_virtual.body import Sensors
from crazyflie_virtual.firmware.controllers import (
    AttitudeController,
    FirmwarePid,
    PositionController,
    wrap_degrees,
)
from crazyflie_virtual.firmware.mellinger import TORQUE_LIMIT, MellingerController
from crazyflie_virtual.firmware.stabilizer import MELLINGER, Stabilizer
from crazyflie_virtual.firmware.states import ABSOLUTE, VELOCITY, Estimate, Modes, Setpoint


def test_pid_parts():
    pid = FirmwarePid(Gains(2.0, 3.0, 0.5), 0.1, kff=0.25)
    assert pid.update(1.0, 0.0) == pytest.approx(2.0 + 3.0 * 0.1 + 0.25)
    # The derivative is of the measurement: a jump of what is desired does not kick.
    output = pid.update(4.0, 0.2)
    assert (pid.out_p, pid.out_d, pid.out_ff) == pytest.approx((7.6, -0.5 * 0.2 / 0.1, 1.0))
    assert pid.out_i == pytest.approx(3.0 * (0.1 + 0.38))
    assert output == pytest.approx(pid.out_p + pid.out_i + pid.out_d + pid.out_ff)


def test_pid_limits_and_reset():
    pid = FirmwarePid(Gains(0.0, 1.0, 0.0, limit=2.0), 1.0, output_limit=1.5)
    assert [pid.update(1.0, 0.0) for _ in range(4)] == [1.0, 1.5, 1.5, 1.5]
    assert pid.out_i == 2.0
    pid.reset()
    assert pid.update(-0.5, 0.0) == -0.5


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_point_the_same_way(angle):
    wrapped = wrap_degrees(angle)
    assert -180.0 <= wrapped < 180.0
    turns = (angle - wrapped) / 360.0
    assert turns == pytest.approx(round(turns), abs=1e-6)


TO_POSITION = Modes(x=ABSOLUTE, y=ABSOLUTE, z=ABSOLUTE)


def setpoint_at(mode=TO_POSITION, **position):
    return Setpoint(mode=mode, **position)


def test_position_errors_tilt_the_vehicle_there():
    # Forward is nose down, negative in the firmware; left is roll to the left, negative.
    roll, pitch, _ = PositionController().update(setpoint_at(x=0.1), Estimate())
    assert pitch < 0.0 == pytest.approx(roll)
    roll, pitch, _ = PositionController().update(setpoint_at(y=0.1), Estimate())
    assert roll < 0.0 == pytest.approx(pitch)
    # The same with the nose to the left: +y is ahead.
    roll, pitch, _ = PositionController().update(setpoint_at(y=0.1), Estimate(yaw=90.0))
    assert pitch < 0.0 == pytest.approx(roll, abs=1e-9)


def test_position_controller_limits():
    controller = PositionController()
    roll, pitch, thrust = controller.update(setpoint_at(x=100.0, y=-100.0, z=100.0), Estimate())
    assert (roll, pitch) == (20.0, -20.0)
    assert controller.vx.desired == pytest.approx(1.1)
    assert thrust == pytest.approx(36000.0 + 1000.0 * (25.0 * 1.1 + 15.0 * 0.011))
    assert controller.update(setpoint_at(z=-100.0), Estimate(vz=10.0))[2] == 20000.0


def test_velocity_setpoints_in_both_frames():
    east = Estimate(yaw=90.0)
    ahead = Setpoint(mode=Modes(x=VELOCITY, y=VELOCITY), vx=0.5, velocity_body=True)
    _, pitch, _ = PositionController().update(ahead, east)
    assert pitch < -5.0
    world = Setpoint(mode=Modes(x=VELOCITY, y=VELOCITY), vy=0.5)
    assert PositionController().update(world, east)[1] == pytest.approx(pitch)


def test_yaw_error_takes_the_shorter_way_round():
    rates = AttitudeController().desired_rates(Estimate(yaw=170.0), 0.0, 0.0, -170.0)
    assert rates[2] > 0.0
    rates = AttitudeController().desired_rates(Estimate(yaw=-170.0), 0.0, 0.0, 170.0)
    assert rates[2] < 0.0


def test_the_cascade_turns_the_vehicle_to_its_setpoint():
    front_right, back_right, back_left, front_left = range(4)

    def commands(**attitude):
        setpoint = Setpoint(thrust=30000.0, **attitude)
        return Stabilizer().update(setpoint, Estimate(), Sensors(noise=False), False, True)

    rolled = commands(roll=5.0)
    assert rolled[front_left] == rolled[back_left] > rolled[front_right] == rolled[back_right]
    # Positive pitch is nose up in the firmware.
    pitched = commands(pitch=5.0)
    assert pitched[front_left] == pitched[front_right] > pitched[back_left] == pitched[back_right]
    turned = commands(mode=Modes(yaw=ABSOLUTE), yaw=5.0)
    assert turned[back_right] == turned[front_left] > turned[front_right] == turned[back_left]


def test_yaw_rate_moves_the_heading_that_is_held():
    stabilizer = Stabilizer()
    setpoint = Setpoint(mode=Modes(yaw=VELOCITY), yaw_rate=50.0, thrust=30000.0)
    for _ in range(100):
        stabilizer.update(setpoint, Estimate(), Sensors(noise=False), False, True)
    assert stabilizer.yaw == pytest.approx(10.0)
    stabilizer.attitude.yaw_max_delta = 5.0
    stabilizer.update(setpoint, Estimate(), Sensors(noise=False), False, True)
    assert stabilizer.yaw == pytest.approx(5.0)


def test_without_thrust_motors_are_off_and_heading_is_the_vehicles():
    stabilizer = Stabilizer()
    commands = stabilizer.update(
        Setpoint(roll=20.0), Estimate(yaw=33.0), Sensors(noise=False), True, True
    )
    assert commands == (0.0,) * 4
    assert stabilizer.yaw == 33.0


def test_mellinger_turns_the_vehicle_to_its_setpoint():
    front_right, back_right, back_left, front_left = range(4)

    def commands(**setpoint):
        stabilizer = Stabilizer()
        stabilizer.controller = MELLINGER
        still = Sensors(noise=False)
        return stabilizer.update(setpoint_at(**setpoint), Estimate(), still, False, True)

    ahead = commands(x=0.1)
    assert ahead[back_left] == ahead[back_right] > ahead[front_left] == ahead[front_right]
    left = commands(y=0.1)
    assert left[front_right] == left[back_right] > left[front_left] == left[back_left]
    up, level = commands(z=0.1), commands()
    assert min(up) > max(level) == pytest.approx(0.027 * 9.81 * 132000.0)
    manual = Modes(roll=ABSOLUTE, pitch=ABSOLUTE, yaw=ABSOLUTE)
    turned = commands(mode=manual, thrust=30000.0, yaw=5.0)
    assert turned[back_right] == turned[front_left] > turned[front_right] == turned[back_left]
    nose_up = commands(mode=manual, thrust=30000.0, pitch=5.0)
    assert nose_up[front_left] == nose_up[front_right] > nose_up[back_left]


def test_mellingers_attitude_has_the_firmwares_signs():
    stabilizer = Stabilizer()
    stabilizer.controller = MELLINGER
    manual = Modes(roll=ABSOLUTE, pitch=ABSOLUTE, yaw=ABSOLUTE)
    setpoint = Setpoint(mode=manual, roll=3.0, pitch=5.0, yaw=7.0, thrust=30000.0)
    stabilizer.update(setpoint, Estimate(), Sensors(noise=False), False, True)
    attitude = (stabilizer.roll, stabilizer.pitch, stabilizer.yaw)
    assert attitude == pytest.approx((3.0, 5.0, 7.0))


TO_FULL_STATE = TO_POSITION._replace(yaw=ABSOLUTE)
RATES = Modes(roll=VELOCITY, pitch=VELOCITY, yaw=VELOCITY)


@pytest.mark.parametrize(("mode", "thrust"), [(TO_FULL_STATE, 0.0), (RATES, 30000.0)])
def test_mellinger_wants_no_attitude_without_a_force(mode, thrust):
    controller = MellingerController()
    if mode is RATES:
        controller.mass = 0.0
    setpoint = setpoint_at(mode, yaw=30.0, az=-GRAVITY, thrust=thrust)
    tilted = Estimate(roll=10.0, pitch=5.0, yaw=30.0)
    outputs = controller.update(setpoint, tilted, Sensors(noise=False))
    assert outputs == pytest.approx((thrust, 0.0, 0.0, 0.0))
    assert controller.attitude == pytest.approx((0.0, 0.0, 0.0))


@pytest.mark.parametrize("beyond", [{"z": math.inf}, {"vz": math.inf}])
def test_mellinger_has_no_direction_of_an_infinite_force(beyond):
    controller = MellingerController()
    outputs = controller.update(setpoint_at(**beyond), Estimate(), Sensors(noise=False))
    # As with the firmware, whose limits of NaN are the lower ones.
    assert outputs == (math.inf, *[-TORQUE_LIMIT] * 3)


def test_motors_set_by_parameter():
    stabilizer = Stabilizer()
    override = stabilizer.override
    override.enable, override.m1, override.m2, override.m3, override.m4 = 1, 10, 20, 30, 40

    def commands(may_run=True):
        return stabilizer.update(Setpoint(), Estimate(), Sensors(noise=False), True, may_run)

    assert commands() == (10.0, 20.0, 30.0, 40.0)
    assert commands(may_run=False) == (0.0,) * 4
    override.enable = 2
    assert commands() == (10.0,) * 4
