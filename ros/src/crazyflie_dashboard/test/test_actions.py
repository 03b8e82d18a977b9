"""Commands: what is called, and what is refused."""

import math

import pytest
from fake_fleet import FakeFleet

from crazyflie_dashboard.control import ControlError
from crazyflie_dashboard.snapshot import Action
from crazyflie_utils.refusal import RefusalError


@pytest.fixture
def fleet():
    found = FakeFleet()
    found.find()
    found.dashboard.pages.take(found.page)
    return found


def called(fleet):
    return [service for service, _ in fleet.calls]


def test_a_takeoff_of_some_calls_their_services(fleet):
    assert fleet.command(Action.TAKEOFF, ["cf1", "cf3"], height=0.8) == {"cf1": "", "cf3": ""}
    assert called(fleet) == ["/cf1/high_level/takeoff", "/cf3/high_level/takeoff"]
    request = fleet.calls[0][1]
    assert request.height == pytest.approx(0.8)
    assert request.duration.to_sec() == pytest.approx(1.6)


def test_each_vehicle_has_its_own_outcome_in_the_words_of_its_service(fleet):
    fleet.refusals["/cf2/high_level/takeoff"] = "the battery is at 2.9 V; expected 3.2 V"
    outcome = fleet.command(Action.TAKEOFF)
    assert outcome == {"cf1": "", "cf2": "the battery is at 2.9 V; expected 3.2 V", "cf3": ""}


def test_going_somewhere_takes_as_long_as_the_speed_says(fleet):
    assert fleet.command(Action.GO_TO, ["cf2"], goal=(1.0, 2.0, 1.0), speed=0.5) == {"cf2": ""}
    ((service, request),) = fleet.calls
    assert service == "/cf2/high_level/go_to"
    assert (request.goal.x, request.goal.y, request.goal.z) == (1.0, 2.0, 1.0)
    assert request.duration.to_sec() == pytest.approx(4.0)
    assert not request.relative


@pytest.mark.parametrize(
    "details",
    [
        {"goal": (math.nan, 0.0, 1.0)},
        {"goal": (0.0, 0.0, math.inf)},
        {"goal": None},
        {"goal": (0.0, 0.0, -1.0)},
        {"goal": (0.0, 0.0, 1.0), "speed": 0.0},
        {"goal": (0.0, 0.0, 1.0), "speed": 50.0},
        {"goal": (0.0, 0.0, 1.0), "yaw": math.nan},
        {"goal": (0.0, 0.0, 1.0), "names": ["cf1", "cf2"]},
    ],
)
def test_moves_that_make_no_sense_are_refused(fleet, details):
    with pytest.raises(RefusalError, match="go to: .*expected"):
        fleet.command(Action.GO_TO, **{"names": ["cf1"], **details})
    assert fleet.calls == []


@pytest.mark.parametrize("age", [1.01, 60.0, -5.0, math.nan])
@pytest.mark.parametrize("action", [Action.TAKEOFF, Action.LAND])
def test_what_has_waited_is_not_carried_out(fleet, action, age):
    with pytest.raises(RefusalError, match="old; expected at most 1 s; nothing was done"):
        fleet.command(action, age=age)
    assert fleet.calls == []


def test_a_service_that_has_gone_is_not_called_when_it_comes_back(fleet):
    services = fleet.process.transport.services
    gone = services.pop("/cf1/high_level/takeoff")
    outcome = fleet.command(Action.TAKEOFF, ["cf1", "cf2"])
    assert "/cf1/high_level/takeoff" in outcome["cf1"]
    assert outcome["cf2"] == ""
    services["/cf1/high_level/takeoff"] = gone
    fleet.process.advance(120.0)
    assert called(fleet) == ["/cf2/high_level/takeoff"]


def test_a_vehicle_that_is_stale_goes_nowhere_and_still_lands(fleet):
    fleet.process.advance(1.0)
    assert fleet.vehicles["cf1"].is_stale
    refused = fleet.command(Action.GO_TO, ["cf1"], goal=(0.0, 0.0, 1.0))["cf1"]
    assert "its position is not known" in refused
    assert fleet.command(Action.LAND, ["cf1"]) == {"cf1": ""}
    assert called(fleet) == ["/cf1/high_level/land"]


def test_what_a_vehicle_does_not_have_is_said(fleet):
    assert fleet.command(Action.REBOOT, ["cf1"]) == {"cf1": "reboot: it has no service for it"}
    assert fleet.command(Action.LAND, ["cf9"]) == {"cf9": "land: there is no such vehicle"}
    with pytest.raises(RefusalError, match="no vehicle is chosen"):
        fleet.command(Action.LAND, [])


def test_a_page_without_control_stops_motors_only(fleet):
    fleet.dashboard.pages.release(fleet.page)
    with pytest.raises(ControlError):
        fleet.command(Action.LAND)
    fleet.dashboard.emergency(None, 0.0)
    fleet.dashboard.emergency(("cf1", "/"), 0.0)
    assert fleet.lane.stopped == [None, ["/cf1/emergency", "/emergency"]]
