"""A vehicle whose own position is not where it is: nothing that is flown by it begins."""

import math

import pytest
from conftest import LOG, PARAMETERS
from genpy import Duration
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Twist, Vector3
from safety_helpers import (
    FLYING,
    HIGH_LEVEL,
    LAND,
    READY,
    TAKEOFF,
    commands,
    is_,
    thrust,
    wait_for_words,
)

from crazyflie_driver.msg import FullState, Hover, Position, VelocityWorld
from crazyflie_driver.positioning import MAX_POSE_DISTANCE, PoseAgreement
from crazyflie_driver.srv import GoToRequest, UpdateParamsRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until
from crazyflie_virtual.testing import virtual_vehicle

COMPLEMENTARY, KALMAN = 1, 2
ESTIMATE = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z")
GO_TO = GoToRequest(duration=Duration(2))
LEVEL = Quaternion(w=1.0)
POSE = Pose(orientation=LEVEL)
REFERENCES = {
    "cmd_position": Position(z=1.0),
    "cmd_full_state": FullState(pose=Pose(Point(0, 0, 1.0), LEVEL)),
    "cmd_hover": Hover(zDistance=1.0),
    "cmd_velocity_world": VelocityWorld(vel=Vector3(0, 0, 0.1)),
}


def add(server, estimator=KALMAN, estimate=(0.0, 0.0, 0.0), state=READY):
    """Return a vehicle with an estimator and what it estimates, m, in a state."""
    vehicle = server.make_vehicle(
        log={**LOG, **dict(zip(ESTIMATE, (("f", part) for part in estimate), strict=True))},
        parameters={**PARAMETERS, "stabilizer.estimator": ("B", estimator, 0)},
    )
    is_(vehicle, READY)
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    is_(vehicle, state)
    if state != READY:
        wait_for_words(server, "flying")
    vehicle.received.clear()
    return vehicle


def send_poses(server, vehicle):
    """Send it poses at the origin until its present estimate has been compared with them."""
    log = server.node._vehicles[vehicle.uri].log
    begin = server.process.clock.time()

    def is_compared():
        server.process.advance(0.05)
        server.process.publish("/cf1/external_position", PointStamped())
        return log.agreement._time > begin + 1.0

    wait_until(is_compared, "a comparison")


def refused(server, words, *services):
    for service, request in services:
        with pytest.raises(ServiceError, match=words):
            server.call(f"/cf1/{service}", request)


@pytest.mark.parametrize("estimate", [(0.0, 0.0, -60.0), (0.0, 0.4, 0.0), (math.nan, 0.0, 0.0)])
def test_no_flight_begins_by_an_estimate_that_differs_from_the_poses(server, estimate):
    vehicle = add(server, estimate=estimate)
    send_poses(server, vehicle)
    words = r"estimates its position as .* and is sent \(0.00, 0.00, 0.00\) m, .* at most 0.3 m"
    refused(server, f"no takeoff: .*{words}", ("takeoff", TAKEOFF))
    for topic, message in REFERENCES.items():
        server.process.publish(f"/cf1/{topic}", message)
    assert "ignoring cmd_position: the vehicle estimates" in server.process.logged("warn")[-1]
    assert commands(vehicle) == []


def test_a_flight_begins_once_the_estimate_follows_the_poses(server):
    vehicle = add(server, estimate=(2.0, 0.0, 0.0))
    send_poses(server, vehicle)
    refused(server, "2.00 m from it", ("takeoff", TAKEOFF))
    vehicle.log["stateEstimate.x"] = ("f", 0.05)
    send_poses(server, vehicle)
    server.call("/cf1/takeoff", TAKEOFF)
    assert commands(vehicle) == [(8, 0)]


@pytest.mark.parametrize("topic", REFERENCES)
def test_the_complementary_filter_flies_by_no_reference(server, topic):
    """A vehicle without decks begins with it; nothing needs to have been sent."""
    vehicle = add(server, COMPLEMENTARY)
    words = r"stabilizer.estimator is 1 \(complementary\).* expected 2 \(Kalman\), set it with"
    refused(server, f"no takeoff: {words}", ("takeoff", TAKEOFF))
    server.process.publish(f"/cf1/{topic}", REFERENCES[topic])
    assert f"ignoring {topic}: stabilizer.estimator is 1" in server.process.logged("warn")[-1]
    assert commands(vehicle) == []
    # What sets no reference passes: an attitude controller needs no estimate of the vehicle.
    thrust(server)
    assert vehicle.wait_for_packets(3, 0)


def test_poses_for_a_filter_that_ignores_them_are_warned_of_at_once(server):
    add(server, COMPLEMENTARY)
    server.process.publish("/cf1/external_pose", PoseStamped(pose=POSE))
    assert "external_pose: stabilizer.estimator is 1" in server.process.logged("warn")[-1]


def fly_on_thrust(server, vehicle):
    for pwm in (0.0, 40_000.0):
        server.process.publish("/cf1/cmd_vel", Twist(Vector3(0, 0, pwm), Vector3()))
    vehicle.wait_for_packets(3, 0)
    wait_for_words(server, "on setpoints")


@pytest.mark.parametrize("estimator", [COMPLEMENTARY, KALMAN])
def test_a_flight_on_thrust_is_not_handed_over_to_a_wrong_estimate(server, estimator):
    vehicle = add(server, estimator, (0.0, 0.0, -60.0), FLYING)
    send_poses(server, vehicle)
    fly_on_thrust(server, vehicle)
    vehicle.received.clear()
    refused(server, "no (land|go_to): ", ("land", LAND), ("go_to", GO_TO))
    # Neither "setpoints stop" nor a command.
    assert {*commands(vehicle)} <= {(3, 0)}
    setpoints = server.node._vehicles[vehicle.uri].setpoints
    assert not setpoints.can_land_autonomously()


def test_flights_by_an_estimate_that_turns_wrong_are_warned_of_and_landed(server):
    """Without the setpoints, or the landing, the vehicle would fall."""
    vehicle = add(server, state=FLYING)
    send_poses(server, vehicle)
    server.process.publish("/cf1/cmd_position", REFERENCES["cmd_position"])
    wait_for_words(server, "on setpoints")
    vehicle.log["stateEstimate.y"] = ("f", -1.0)
    vehicle.received.clear()
    send_poses(server, vehicle)
    assert "1.00 m from it" in server.process.logged("warn")[-1]
    server.process.publish("/cf1/cmd_position", REFERENCES["cmd_position"])
    assert vehicle.wait_for_packets(7, 0)
    assert "cmd_position in flight: the vehicle estimates" in " ".join(
        server.process.logged("warn")
    )
    send_poses(server, vehicle)
    is_(vehicle, HIGH_LEVEL)
    server.call("/cf1/land", LAND)
    assert (8, 0) in commands(vehicle)
    assert any(
        "land may end elsewhere: the vehicle estimates" in each
        for each in server.process.logged("warn")
    )


def test_a_fast_vehicle_agrees_with_the_poses_it_was_sent_before():
    """An estimate that is 0.2 s late, at 4 m/s."""
    agreement = PoseAgreement()
    for step in range(300):
        now = 0.01 * step
        agreement.pose(now, (4.0 * now, 0.0, 1.0))
        agreement.estimate(now, (4.0 * max(0.0, now - 0.2), 0.0, 1.0))
        assert agreement.problem(now) == ""


def test_the_difference_has_a_limit_and_is_known_for_a_while_only():
    agreement = PoseAgreement()
    agreement.estimate(0.9, (5.0, 0.0, 0.0))
    assert agreement.problem(0.9) == ""
    for distance, is_found in ((MAX_POSE_DISTANCE - 0.01, False), (MAX_POSE_DISTANCE + 0.01, True)):
        agreement.pose(1.0, (0.0, 0.0, 0.0))
        agreement.estimate(1.1, (0.0, distance, 0.0))
        assert bool(agreement.problem(1.1)) is is_found
    assert agreement.problem(2.5) != ""
    assert agreement.problem(2.7) == ""
    # No pose of the last half second: nothing is known.
    agreement.estimate(1.6, (0.0, 5.0, 0.0))
    assert agreement.problem(1.6) == ""


def test_a_vehicle_without_decks_takes_off_once_its_estimator_is_the_kalman_filter(server):
    with virtual_vehicle(positioning="none", estimator=COMPLEMENTARY) as (_, uri):
        server.add(uri, enable_parameters=True)
        refused(server, "stabilizer.estimator is 1", ("takeoff", TAKEOFF))
        server.process.transport.parameters["/cf1/stabilizer/estimator"] = KALMAN
        server.call("/cf1/update_params", UpdateParamsRequest(["stabilizer/estimator"]))
        log = server.node._vehicles[uri].log

        def is_ready():
            server.process.advance(0.02)
            server.process.publish("/cf1/external_pose", PoseStamped(pose=POSE))
            problem = log.estimate_problem() or log.variances.problem()
            return log.variances.are_enough and not problem

        wait_until(is_ready, "an estimate at the poses")
        server.call("/cf1/takeoff", TAKEOFF)
