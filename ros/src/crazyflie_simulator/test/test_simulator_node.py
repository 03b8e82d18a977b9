"""The simulator nodes on a fake process."""

import math

import numpy as np
import pytest
from simulators import NODES, PARAMETERS, command, heights, launch, refusal, transforms
from std_srvs.srv import EmptyRequest

from crazyflie_model.dynamics import NearHover
from crazyflie_msgs.msg import Control, ControlStamped, Disturbance, DisturbanceStamped
from crazyflie_simulator.quadrotor_simulator_node import QuadrotorSimulatorNode
from crazyflie_simulator.simulator_node import (
    NearHoverSimulatorCoupled7DNode,
    NearHoverSimulatorNode,
)
from crazyflie_utils import NodeHandle, ServiceError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.timers import SimulatedClock


def fly(process, count, thrust, period=0.1, **control):
    """Send a control so many times, one every period (s)."""
    for _ in range(count):
        command(process, thrust, **control)
        process.advance(period)


@NODES
@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_is_required(node_class, name):
    assert f"/simulator/{name} is not set; expected" in refusal(node_class, **{name: None})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("time_step", -0.01),
        ("time_step", 0),
        ("time_step", math.nan),
        ("time_step", "fast"),
        ("init/x", "left"),
        ("init/z", math.inf),
        ("frames/robot", 3),
        ("topics/control", ""),
        ("clock/publish", 1),
        ("clock/real_time_factor", -1.0),
        ("mocap/position_noise", -0.001),
        ("mocap/attitude_noise", math.nan),
        ("mocap/latency", "late"),
        ("mocap/dropout", 1.1),
        ("seed", -1),
        ("seed", 0.5),
        ("mass_error", -0.6),
        ("thrust_error", math.nan),
        ("wind/x", "north"),
        ("wind/gust", -1.0),
        ("wind/gust_time", 0.0),
    ],
)
def test_bad_parameters_are_named(name, value):
    text = refusal(QuadrotorSimulatorNode, **{name: value})
    assert f"/simulator/{name} is {value!r}; expected" in text


@NODES
def test_broadcasts_every_time_step_with_the_vehicles_stamp(node_class):
    process = launch(node_class)
    process.advance(1.0)
    stamps = [transform.header.stamp.to_sec() for transform in transforms(process)]
    assert stamps == pytest.approx([100.0 + 0.01 * k for k in range(1, 101)])
    transform = transforms(process)[-1]
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "crazyflie")
    assert transform.transform.translation.x == 1.0
    assert transform.transform.translation.y == 2.0
    assert transform.transform.rotation.w == 1.0


def test_a_time_step_below_that_of_the_model_repeats_no_stamp():
    process = launch(time_step=0.0004)
    process.advance(0.1)
    stamps = [transform.header.stamp for transform in transforms(process)]
    assert len(stamps) == len(set(stamps)) == 101


@pytest.mark.parametrize("node_class", [NearHoverSimulatorNode, NearHoverSimulatorCoupled7DNode])
def test_climbs_on_command(node_class):
    process = launch(node_class)
    fly(process, 10, 11.81)
    assert heights(process)[-1] == pytest.approx(1.0)


def test_the_quadrotor_climbs_when_its_motors_have_run_up():
    process = launch(QuadrotorSimulatorNode)
    fly(process, 10, 11.81)
    assert 0.4 < heights(process)[-1] < 1.0


@NODES
def test_tilts_and_turns_the_right_way(node_class):
    process = launch(node_class, **{"init/z": 5.0})
    fly(process, 10, 9.81, roll=-0.1, pitch=0.1, yaw_dot=0.2)
    last = transforms(process)[-1].transform
    assert last.translation.x > 1.1
    assert last.translation.y > 2.1
    assert last.rotation.x < 0.0 < min(last.rotation.y, last.rotation.z)


def test_a_control_between_ticks_takes_effect_at_once():
    process = launch(time_step=0.5)
    process.advance(0.25)
    command(process, 11.81)
    process.advance(0.25)
    assert heights(process) == [pytest.approx(0.5 * 2.0 * 0.25**2)]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@NODES
def test_the_last_good_control_does_not_outlive_bad_ones(node_class, bad):
    process = launch(node_class, **{"init/z": 50.0})
    command(process, 9.81, pitch=0.1)
    for _ in range(40):
        process.advance(0.1)
        command(process, bad)
    assert all(map(math.isfinite, heights(process)))
    speeds = np.diff([transform.transform.translation.x for transform in transforms(process)])
    falls = np.diff(heights(process))
    # Pitched for half a second, then level, and from two seconds on without thrust.
    assert speeds[48] > speeds[20] > 0.0
    assert transforms(process)[150].transform.rotation.y == pytest.approx(0.0, abs=0.02)
    np.testing.assert_allclose(falls[100:198], falls[100], atol=1e-3)
    assert falls[-1] < -0.1
    (warning,) = {*process.logged("warn")}
    assert "/control/final" in warning


@pytest.mark.parametrize("field", ["roll", "pitch", "yaw_dot", "thrust"])
def test_every_field_of_a_control_is_looked_at(field):
    process = launch()
    process.publish(
        "/control/final", ControlStamped(control=Control(**{"thrust": 20.0, field: math.nan}))
    )
    process.advance(0.3)
    assert heights(process)[-1] == 0.0


def test_a_good_control_is_taken_again_after_bad_ones():
    process = launch()
    for _ in range(30):
        command(process, math.nan)
        process.advance(0.1)
    command(process, 10.81)
    process.advance(0.2)
    assert heights(process)[-1] == pytest.approx(0.5 * 0.2**2)


def test_motion_capture_errors_are_reproducible_and_each_vehicle_s_own():
    def broadcast(name, seed):
        process = FakeProcess()
        errors = {"mocap/position_noise": 0.001, "mocap/attitude_noise": 0.01, "seed": seed}
        errors |= {"mocap/latency": 0.03, "mocap/dropout": 0.1}
        assert process.launch(NearHoverSimulatorNode(), name, PARAMETERS | errors)
        process.advance(1.0)
        return transforms(process)

    assert broadcast("/simulator", 0) == broadcast("/simulator", 0)
    assert broadcast("/simulator", 0) != broadcast("/simulator", 1)
    assert broadcast("/cf1/simulator", 0) != broadcast("/cf2/simulator", 0)
    stamps = [transform.header.stamp.to_sec() for transform in broadcast("/simulator", 0)]
    assert 70 < len(stamps) <= 97
    assert stamps[-1] <= 100.97 + 1e-6


def test_wind_blows_the_quadrotor_along():
    process = launch(QuadrotorSimulatorNode, **{"init/z": 5.0, "wind/y": -3.0})
    fly(process, 10, 9.81)
    assert transforms(process)[-1].transform.translation.y < 1.9


def test_mass_and_thrust_errors_of_the_quadrotor():
    process = launch(QuadrotorSimulatorNode, mass_error=0.1, thrust_error=-0.1)
    command(process, 9.81 * 1.1 / 0.9 - 0.1)
    process.advance(0.4)
    assert heights(process)[-1] == 0.0
    command(process, 9.81 * 1.1 / 0.9 + 0.5)
    process.advance(0.4)
    assert heights(process)[-1] > 0.0


# Changes in flight.


@NODES
def test_motion_capture_may_fail_in_flight(node_class):
    process = launch(node_class)
    process.advance(0.1)
    process.reconfigure("/simulator", **{"mocap/dropout": 1.0})
    process.advance(0.1)
    assert len(transforms(process)) == 10
    process.reconfigure("/simulator", **{"mocap/dropout": 0.0, "mocap/position_noise": 0.1})
    process.advance(0.1)
    assert len(transforms(process)) == 20
    assert heights(process)[9] == 0.0 != heights(process)[10]


def test_latency_may_change_in_flight():
    process = launch()
    process.advance(0.1)
    process.reconfigure("/simulator", **{"mocap/latency": 0.05})
    process.advance(0.1)
    process.reconfigure("/simulator", **{"mocap/latency": 0.0})
    process.advance(0.1)
    stamps = [transform.header.stamp.to_sec() for transform in transforms(process)]
    assert stamps == pytest.approx([100.0 + 0.01 * k for k in range(1, 31)])


def test_wind_may_rise_in_flight():
    process = launch(QuadrotorSimulatorNode, **{"init/z": 5.0})
    command(process, 9.81)
    process.advance(0.4)
    assert transforms(process)[-1].transform.translation.y == 2.0
    process.reconfigure("/simulator", **{"wind/y": -3.0, "wind/gust": 0.1})
    process.advance(0.4)
    assert transforms(process)[-1].transform.translation.y < 1.999


def test_mass_may_change_in_flight():
    process = launch(QuadrotorSimulatorNode, **{"init/z": 5.0})
    command(process, 9.81)
    process.advance(0.4)
    assert heights(process)[-1] == pytest.approx(5.0, abs=1e-3)
    process.reconfigure("/simulator", mass_error=0.1)
    process.advance(0.4)
    assert heights(process)[-1] < 4.99


@pytest.mark.parametrize(("name", "value"), [("mocap/dropout", 1.1), ("time_step", 0.1)])
def test_bad_changes_are_refused(name, value):
    process = launch()
    with pytest.raises(ServiceError, match=name):
        process.reconfigure("/simulator", **{name: value})
    process.advance(0.1)
    assert len(transforms(process)) == 10


@pytest.mark.parametrize("start", [5000.0, 1795944674.8])
def test_a_clock_that_begins_anywhere_is_no_jump(start):
    process = FakeProcess(start=0.0)
    process.launch(NearHoverSimulatorNode(), "/simulator", PARAMETERS)
    process.set_clock(start)
    process.advance(0.02)
    assert process.logged("warn") == []
    process.set_clock(start + 3600.0)
    process.advance(0.02)
    assert "time has jumped by 3599" in process.logged("warn")[0]


def test_a_clock_that_jumps_forward_is_not_simulated_step_by_step(monkeypatch):
    process = launch()
    command(process, 9.81)
    process.advance(0.1)
    taken = []
    steps = NearHover.steps
    monkeypatch.setattr(NearHover, "steps", lambda *a: taken.append(a[1]) or steps(*a))
    process.clock.set(process.clock.time() + 3600.0)
    process.advance(0.02)
    assert 900 < sum(taken) <= 1030
    (warning,) = process.logged("warn")
    assert "the vehicle skips that" in warning
    stamps = [transform.header.stamp for transform in transforms(process)]
    assert stamps[-1].to_sec() == pytest.approx(process.clock.time(), abs=2e-3)
    assert stamps == sorted(stamps)


def test_a_quadrotor_that_tips_over_falls_until_it_is_reset():
    process = launch(QuadrotorSimulatorNode, **{"init/z": 50.0})
    fly(process, 150, 9.81, 0.01, roll=1.4)
    (warning,) = process.logged("warn")
    assert "60 degrees" in warning and "/simulator/reset" in warning
    falling = heights(process)[-10:]
    fly(process, 1, 16.0, 0.3)
    assert heights(process)[-1] < falling[-1] - 0.3
    fly(process, 1000, 16.0, 0.01)
    assert heights(process)[-1] == 0.0
    process.call("/simulator/reset", EmptyRequest())
    fly(process, 100, 12.0, 0.01)
    assert heights(process)[-1] > 0.3


@pytest.mark.parametrize("has_control", [False, True])
def test_poses_that_the_machine_was_too_busy_for_are_made_up_for(monkeypatch, has_control):
    # As in real time, where ticks may be late.
    monkeypatch.setattr(NodeHandle, "uses_sim_time", property(lambda handle: False))
    process = launch(time_step=0.001)
    for late in (0.001, 0.0045, 0.0055, 0.006, 0.011):
        process.clock.set(100.0 + late)
        if has_control:
            command(process, thrust=9.81)
    stamps = [transform.header.stamp.to_sec() for transform in transforms(process)]
    assert stamps == pytest.approx([100.0 + 0.001 * k for k in range(1, 12)])
    # But not for all of a night.
    process.clock.set(200.0)
    assert len(transforms(process)) == 111
    assert transforms(process)[-1].header.stamp.to_sec() == pytest.approx(200.0)


@NODES
def test_a_simulator_does_not_join_the_flight_of_a_real_vehicle(node_class):
    process = FakeProcess()
    process.transport.foreign_services["/control/final/vehicle"] = "/cmd_vel_converter"
    parameters = {**PARAMETERS, "topics/control": "/control/final"}
    assert not process.launch(node_class(), "/simulator", parameters)
    assert (
        "/control/final already fly a vehicle of /cmd_vel_converter" in process.logged("error")[0]
    )


def test_poses_are_those_of_their_stamps_where_a_control_is_interrupted(monkeypatch):
    monkeypatch.setattr(NodeHandle, "uses_sim_time", property(lambda handle: False))
    time, delays = SimulatedClock.time, iter(())
    monkeypatch.setattr(SimulatedClock, "time", lambda clock: time(clock) + next(delays, 0.0))
    process = launch(time_step=0.001)
    fly(process, 10, 9.81, pitch=0.1)
    before = len(transforms(process))
    for _ in range(20):
        # Another process runs between two readings of the clock.
        delays = iter((0.0, 0.004, 0.004))
        command(process, thrust=9.81)
        delays = iter(())
        process.advance(0.01)
    moved = transforms(process)[before:]
    ways = [each.transform.translation.x for each in moved]
    stamps = [each.header.stamp.to_sec() for each in moved]
    speeds = np.diff(ways) / np.diff(stamps)
    assert len(speeds) > 190
    assert np.ptp(speeds) < 0.01


@pytest.mark.parametrize("node_class", [NearHoverSimulatorNode, NearHoverSimulatorCoupled7DNode])
def test_a_disturbance_is_added_to_the_derivatives_until_the_next_one(node_class):
    process = launch(node_class, **{"topics/disturbance": "/disturbance", "init/z": 1.0})
    fly(process, 5, 9.81)

    def disturb(**values):
        process.publish("/disturbance", DisturbanceStamped(disturbance=Disturbance(**values)))

    def place():
        translation = transforms(process)[-1].transform.translation
        return translation.x, translation.y, translation.z

    begin = place()
    disturb(x_dot=0.5, y=0.2)
    fly(process, 10, 9.81)
    accelerated = place()
    assert np.subtract(accelerated, begin) == pytest.approx((0.25, 0.2, 0.0), abs=0.01)
    disturb()
    fly(process, 10, 9.81)
    assert np.subtract(place(), accelerated) == pytest.approx((0.5, 0.0, 0.0), abs=0.01)
    # One that is not a number changes nothing.
    disturb(z_dot=math.nan)
    fly(process, 1, 9.81)
    assert place()[2] == pytest.approx(begin[2], abs=1e-6)
