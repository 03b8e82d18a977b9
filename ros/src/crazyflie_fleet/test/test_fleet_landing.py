"""Landings of a fleet, and of single vehicles in it: none comes down on another."""

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point
from simulated_fleet import Swarm
from std_msgs.msg import Float32, String
from std_srvs.srv import EmptyRequest

from crazyflie_driver.srv import GoToRequest
from crazyflie_fleet import landing_rounds
from crazyflie_msgs.msg import FlightStatus, PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils import ServiceError
from crazyflie_utils.flight_status import WORDS


class Tower(Swarm):
    """Vehicles above each other, with one next to them."""

    def __init__(self, heights=(1.0, 2.0, 3.0)):
        super().__init__(fleet={"n": 4, "spacing": 1.0})
        self.call("/all/takeoff")
        goals = {f"cf{k}": (-0.5, -0.5, z) for k, z in enumerate(heights, 1)}
        # First to their heights, then above each other.
        self.go_to({name: (*self.position(name)[:2], goals[name][2]) for name in goals})
        self.go_to(goals)
        for name, goal in goals.items():
            assert self.position(name) == pytest.approx(goal, abs=0.1)

    def go_to(self, places):
        for name, place in places.items():
            request = GoToRequest(0, False, Point(*place), 0.0, rospy.Duration(5.0))
            self.process.call(f"/{name}/go_to", request)
        self.process.advance(6.0)

    def nearest(self):
        """Return the least distance that a vehicle in the air had; heights count for half."""
        tracks = [self.process.published(f"/cf{k}/state") for k in (1, 2, 3, 4)]
        places = [
            np.array([(m.state.x, m.state.y, 0.5 * m.state.z) for m in track[self.begin :]])
            for track in tracks
        ]
        n = min(map(len, places))
        pairs = [(a[:n], b[:n]) for k, a in enumerate(places) for b in places[:k]]
        return min(
            np.where(np.maximum(a, b)[:, 2] > 0.01, np.linalg.norm(a - b, axis=1), np.inf).min()
            for a, b in pairs
        )

    @property
    def begin(self):
        return self._begin

    def mark(self):
        self._begin = len(self.process.published("/cf1/state"))

    def lands(self, seconds):
        """Return the flight states after some seconds."""
        self.process.advance(seconds)
        return self.states()

    def states(self):
        topics = [f"/cf{k}/in_flight_flight_status" for k in (1, 2, 3, 4)]
        return [WORDS[self.process.published(topic)[-1].state] for topic in topics]


def test_vehicles_above_each_other_do_not_land_on_each_other():
    tower = Tower()
    tower.mark()
    tower.call("/all/land", seconds=60.0)
    assert [tower.position(f"cf{k}")[2] for k in (1, 2, 3, 4)] == pytest.approx([0.0] * 4, abs=0.02)
    # Buffers are 0.15 m.
    assert tower.nearest() > 0.3
    assert tower.position("cf1") == pytest.approx((-0.5, -0.5, 0.0), abs=0.05)


def end_launch(tower):
    tower.process.prepare_shutdown(tower.nodes)
    # A process lives on for 10 s.
    tower.process.advance(10.0)


def land_the_upper_ones(tower):
    for name in ("cf3", "cf2"):
        tower.process.call(f"/{name}/land", EmptyRequest())
        tower.process.advance(1.0)
    tower.process.advance(25.0)


def empty_the_batteries(tower):
    for _ in range(80):
        for name in ("cf2", "cf3"):
            tower.process.publish(f"/{name}/battery", Float32(2.8))
        tower.process.advance(0.25)


@pytest.mark.parametrize(
    "end",
    [
        end_launch,
        # That they land at all is tested in test_group_services.py, and in test_battery.py.
        pytest.param(land_the_upper_ones, marks=pytest.mark.long),
        pytest.param(empty_the_batteries, marks=pytest.mark.long),
    ],
)
def test_a_vehicle_that_lands_by_itself_lands_beside_those_beneath_it(end):
    # As near to each other as their buffers allow.
    tower = Tower((0.7, 1.35, 2.0))
    tower.mark()
    end(tower)
    down = [WORDS[FlightStatus.ON_GROUND]] * 3
    if end is not end_launch:
        down[0] = "flying"
    assert tower.states()[:3] == down
    assert tower.nearest() > 0.3
    assert tower.position("cf1")[:2] == pytest.approx((-0.5, -0.5), abs=0.05)


def test_references_of_others_do_not_disturb_a_landing():
    tower = Tower()
    tower.mark()
    answer = tower.process.call("/land_all", EmptyRequest())
    up = PositionVelocityStateStamped(state=PositionVelocityState(x=-0.5, y=-0.5, z=3.0))

    def insist():
        up.header.stamp = tower.process.clock.stamp()
        tower.process.publish("/cf3/ref", up)

    timer = tower.process.timers().add(0.05, insist)
    tower.advance_until(answer.done, 60.0)
    timer.stop()
    answer.result(0)
    assert tower.position("cf3")[2] == pytest.approx(0.0, abs=0.02)
    assert tower.nearest() > 0.3
    # Afterwards its references count again.
    tower.call("/cf3/takeoff")
    tower.process.advance(3.0)
    insist()
    tower.process.advance(0.1)
    assert tower.process.published("/cf3/ref_safe")[-1].state.z == 3.0


def test_vehicles_of_a_mission_that_has_died_are_landed():
    tower = Tower()
    tower.mark()
    for _ in range(10):
        tower.process.publish("/all/mission", String("m1 cf1 cf2 cf3"))
        tower.process.advance(0.5)
    # One that has landed its vehicles may end.
    tower.process.publish("/all/mission", String("m2 cf4"))
    tower.process.publish("/all/mission", String("m2"))
    assert tower.lands(4.0) == ["flying"] * 4
    down = [WORDS[FlightStatus.ON_GROUND]] * 3 + ["flying"]
    tower.advance_until(lambda: tower.states() == down, 60.0)
    assert tower.states() == down
    assert tower.nearest() > 0.3
    assert tower.process.logged("error") == [
        "/fleet: no message from the mission that flew cf1, cf2, cf3 for 5 s: it has ended; "
        "landing these vehicles"
    ]


def test_a_vehicle_that_cannot_leave_stays_in_the_air_and_is_named():
    tower = Tower()
    go_to = tower.process.transport.services["/cf2/go_to"]
    # It is led to where it is.
    here = Point(*tower.position("cf2"))
    tower.process.transport.services["/cf2/go_to"] = lambda request: go_to(
        GoToRequest(0, False, here, 0.0, request.duration)
    )
    with pytest.raises(ServiceError, match="1 of 4 vehicles: cf2: stays in the air: .* is 0.[34]"):
        tower.call("/all/land", seconds=90.0)
    assert tower.position("cf2")[2] > 1.8
    for name in ("cf1", "cf3", "cf4"):
        assert tower.position(name)[2] == pytest.approx(0.0, abs=0.02)
    # Nor does a refusal end the landing of the others.
    tower.process.transport.services["/cf2/go_to"] = go_to
    tower.call("/cf2/go_to", GoToRequest(0, False, Point(-1.5, 0.5, 1.0), 0.0, rospy.Duration(8.0)))
    tower.process.advance(9.0)
    tower.call("/all/land", seconds=10.0)
    assert "/fleet: on the ground already: cf1, cf3, cf4" in tower.process.logged("info")
    assert tower.position("cf2")[2] == pytest.approx(0.0, abs=0.02)


def test_a_landing_that_fails_is_answered(monkeypatch):
    swarm = Swarm(fleet={"n": 2})
    swarm.call("/all/takeoff")
    monkeypatch.setattr(landing_rounds.Scene, "next_round", lambda _: {}["a bug"])
    with pytest.raises(
        ServiceError, match="2 of 2 vehicles: cf1, cf2: the landing of the fleet has f"
    ):
        swarm.call("/all/land")
    monkeypatch.undo()
    swarm.call("/all/land", seconds=6.0)
    assert swarm.position("cf2")[2] == pytest.approx(0.0, abs=0.02)
