"""Missions without vehicles: what is refused, and what it says."""

import math
import re

import numpy as np
import pytest

from crazyflie_demo.figure8 import figure8
from crazyflie_mission_api import Bounds, DryRun, Limits, MissionError, plan
from crazyflie_mission_api.dry_run import DryRunClock, dry_run
from crazyflie_mission_api.group_state import Rules
from crazyflie_model.trajectory import duration, moved, stretched

ROOM = Bounds((-2.0, -2.0, 0.0), (2.0, 2.0, 2.0))
STARTS = {"cf1": (0.0, 0.0, 0.0), "cf2": (1.0, 0.0, 0.0)}


@pytest.fixture
def group():
    """Return two vehicles on the ground of a room."""
    return DryRun(STARTS, Rules(bounds=ROOM))


@pytest.fixture
def flying(group):
    """Return two vehicles that hover at 1 m."""
    group.takeoff(1.0)
    return group


def test_a_mission_from_takeoff_to_landing(group):
    with group:
        group.takeoff(1.0)
        assert group.flying == ["cf1", "cf2"]
        assert group.position("cf2") == pytest.approx((1.0, 0.0, 1.0))
        group.go_to({"cf1": (-1.0, 0.0, 1.0), "cf2": (1.0, 1.0, 1.5)})
        assert group.position("cf1") == pytest.approx((-1.0, 0.0, 1.0))
        group["cf2"].go_to((0.0, 0.5, 0.0), relative=True)
        assert group.position("cf2") == pytest.approx((1.0, 1.5, 1.5))
        group["cf1"].follow(plan([(-1, 0, 1), (-1, 1, 1), (-1.5, 0, 1)]))
        assert group.position("cf1") == pytest.approx((-1.5, 0.0, 1.0))
        group.go_to((0.0, 0.0, -0.2), relative=True)
        assert group.position("cf1") == pytest.approx((-1.5, 0.0, 0.8))
    assert group.flying == []
    assert group.position("cf1") == pytest.approx((-1.5, 0.0, 0.0))


def test_going_nowhere_is_no_error(flying):
    flying.go_to((0.0, 0.0, 0.0), relative=True)
    flying.formation([(1.0, 0.0, 1.0), (0.0, 0.0, 1.0)])
    flying["cf1"].go_to((1e-60, 0.0, 0.0), relative=True)
    assert flying.position("cf2") == pytest.approx((1.0, 0.0, 1.0))


def test_a_takeoff_to_where_the_vehicle_is_is_refused():
    table = DryRun({"cf1": (0.0, 0.0, 1.0)})
    with pytest.raises(MissionError, match="the height is 1 m, and the vehicle is at 1.00 m"):
        table.takeoff(1.0)
    assert table.flying == []


def yaws(group):
    """Return where the vehicles are told to head, rad."""
    return [group._commanded[name].destination.yaw for name in group.names]


def test_a_heading_is_kept_unless_another_is_told():
    group = DryRun(STARTS, headings={"cf1": 1.0, "cf2": -0.5})
    group.takeoff(1.0)
    assert yaws(group) == [1.0, -0.5]
    group.go_to({"cf1": (0.0, 1.0, 1.0)})
    group.formation([(1.0, 1.0, 1.0), (0.0, 1.0, 1.0)])
    assert yaws(group) == [1.0, -0.5]
    group["cf1"].go_to((0.0, 1.0, 1.2), yaw=0.0)
    assert yaws(group) == pytest.approx([0.0, -0.5])


def test_a_relative_heading_is_relative():
    group = DryRun(STARTS, headings={"cf1": 1.0, "cf2": -0.5})
    group.takeoff(1.0)
    group.go_to((0.0, 0.0, 0.2), yaw=0.25, relative=True)
    assert yaws(group) == pytest.approx([1.25, -0.25])
    # The velocity is in the vehicle's heading frame, which turns at its yaw rate.
    begin = group.time()
    group["cf1"].go_to((0.0, 0.0, 1.2), yaw=1.25 - math.pi)
    assert group.time() - begin == pytest.approx(math.pi * 35.0 / 16.0 / 1.5, abs=0.06)


def test_the_way_takes_as_long_as_the_limits_demand(flying):
    begin = flying.time()
    flying["cf1"].go_to((-1.0, 0.0, 1.0))
    # The polynomial from rest to rest is 35/16 times as fast in its middle as on average.
    assert flying.time() - begin == pytest.approx(35.0 / 16.0 / 0.5, abs=0.06)


def test_some_fly_while_others_wait(flying):
    flying["cf1"].go_to((-1.0, 0.0, 1.0), wait=False)
    assert flying.position("cf1") == pytest.approx((0.0, 0.0, 1.0))
    flying["cf2"].go_to((1.0, 0.2, 1.0))
    with pytest.raises(MissionError, match=r"cf1: go_to: the vehicle is under way for another \d"):
        flying["cf1"].go_to((0.0, 0.0, 1.0))
    flying.arrive()
    assert flying.position("cf1") == pytest.approx((-1.0, 0.0, 1.0))


def test_a_trajectory_can_be_slower_and_elsewhere(flying):
    flying["cf1"].go_to((-1.0, 0.0, 1.0))
    begin = flying.time()
    flying["cf1"].follow(figure8(), timescale=2.0, relative=True)
    assert flying.time() - begin == pytest.approx(20.0)
    assert flying.position("cf1") == pytest.approx((-1.0, 0.0, 1.0))


def one_behind_the_other(fleet):
    """Fly in a row, 1 m apart, at 0.5 m/s in the middle of the way."""
    fleet.takeoff(1.0)
    fleet.go_to((1.0, 0.0, 0.0), relative=True)


def test_vehicles_that_do_not_begin_together_are_checked_as_if_each_were_late():
    rules = Rules(separation=0.95)
    one_behind_the_other(DryRun(STARTS, rules))
    late = DryRun(STARTS, rules, start_skews={"cf1": 0.15, "cf2": 0.15})
    text = (
        r"cf1 and cf2 would be 0.949 m apart, \d.\d s from now; expected at least 0.95 m; "
        r"this happens if cf2 begins 0.15 s after the others"
    )
    with pytest.raises(MissionError, match=text):
        one_behind_the_other(late)
    # The other one is earlier then.
    mixed = DryRun(STARTS, rules, start_skews={"cf1": 0.15})
    with pytest.raises(MissionError, match="if cf2 begins 0.15 s after the others"):
        one_behind_the_other(mixed)
    # A vehicle that is under way already may also have begun late.
    late = DryRun(STARTS, Rules(separation=0.96), start_skews={"cf1": 0.15, "cf2": 0.15})
    late.takeoff(1.0)
    late["cf2"].go_to((2.0, 0.0, 1.0), wait=False)
    late.wait(0.05)
    with pytest.raises(MissionError, match="if cf2 begins"):
        late["cf1"].go_to((1.0, 0.0, 1.0))


def test_a_formation_sends_each_vehicle_to_the_place_that_suits(flying):
    gone = flying.formation([(1.0, 1.0, 1.0), (0.0, 1.0, 1.0)])
    assert gone == {"cf1": (0.0, 1.0, 1.0), "cf2": (1.0, 1.0, 1.0)}


def test_an_error_in_flight_ends_with_a_landing(group):
    with pytest.raises(ZeroDivisionError), group:
        group.takeoff(1.0)
        group.wait(1 / 0)
    assert group.flying == []
    assert group.position("cf1")[2] == pytest.approx(0.0)


def test_colors_are_checked(flying):
    before = flying.time()
    flying.set_led_color(0, 0.5, 1)
    assert flying.time() == before
    for wrong in (1.5, -0.1, math.nan, "1"):
        with pytest.raises(MissionError, match=f"set_led_color: blue is {wrong!r}; expected .*1"):
            flying["cf1"].set_led_color(0.0, 0.0, wrong)


def test_an_emergency_is_no_landing(flying):
    flying["cf1"].emergency()
    assert flying.flying == ["cf2"]
    assert flying.position("cf1")[2] == 0.0


def test_a_dry_run_has_the_positions_of_the_vehicles(group):
    def mission(fleet):
        fleet.takeoff(1.0)
        fleet.go_to({"cf1": (0.0, 3.0, 1.0)})

    with pytest.raises(MissionError, match=r"cf1: go_to is out of bounds: y is 3 m; expected -2"):
        dry_run(group, mission)
    assert group.flying == []
    assert dry_run(group, lambda fleet: fleet.takeoff(1.0)) > 4.0


def test_a_dry_run_begins_on_the_ground_and_tells_its_duration(group):
    assert dry_run(group, lambda fleet: fleet.wait(2.0)) == pytest.approx(2.0)
    group.takeoff(1.0)
    with pytest.raises(MissionError, match="cf1, cf2: in flight; expected to be on the ground"):
        dry_run(group, lambda fleet: None)


def test_waiting_ends_with_its_condition_or_at_its_deadline():
    clock = DryRunClock()
    assert clock.wait_until(lambda: True, 5.0)
    assert clock.time() == 0.0
    assert not clock.wait_until(lambda: False, 0.12)
    assert clock.time() == 0.12


def test_a_dry_run_has_the_headings_of_the_vehicles():
    group = DryRun(STARTS, headings={"cf1": math.pi / 2})

    def mission(fleet):
        fleet.takeoff(1.0)
        assert yaws(fleet) == pytest.approx([math.pi / 2, 0.0], abs=1e-12)

    dry_run(group, mission)


BAD = {
    "no vehicle has the name 'cf3'; expected one of cf1, cf2": lambda t: t["cf3"],
    "cf1: takeoff: the vehicle flies already": lambda t: t.takeoff(1.0),
    r"go_to: one goal \(0, 0, 1\) for 2 vehicles": lambda t: t.go_to((0, 0, 1)),
    "cf1: goal is 5; expected x, y, z": lambda t: t.go_to({"cf1": 5}),
    r"cf1: goal is \(0, nan, 1\)": lambda t: t.go_to({"cf1": (0, math.nan, 1)}),
    "cf2: go_to is out of bounds: x is 3 m; expected -2 to 2 m": lambda t: t["cf2"].go_to(
        (3, 0, 1)
    ),
    r"cf1 and cf2 would be 0\.\d+ m apart, \d\.\d s from now": lambda t: t["cf1"].go_to(
        (0.9, 0, 1)
    ),
    r"cf1 and cf2 would be 0\.\d+ m apart, \d\.\d s from now; expected at": lambda t: t[
        "cf1"
    ].go_to((2, 0, 1)),
    "cf1: go_to: the speed is .* m/s at .* expected at most 0.5 m/s; a longer duration": lambda t: (
        t["cf1"].go_to((0, 1, 1), duration=1.0)
    ),
    "go_to: duration is 'long'; expected a finite number": lambda t: t["cf1"].go_to(
        (0, 1, 1), duration="long"
    ),
    r"begins at \(0.00, 0.00, 0.00\), 1.00 m from the vehicle": lambda t: t["cf1"].follow(
        figure8()
    ),
    "cf1: trajectory: the speed is 0.83": lambda t: t["cf1"].follow(figure8(), relative=True),
    "cf1: trajectory has no pieces": lambda t: t["cf1"].follow([]),
    "cf1: trajectory is 'eight.csv'; expected a list of": lambda t: t["cf1"].follow("eight.csv"),
    "follow: no trajectories are given": lambda t: t.follow({}),
    "go_to: no goals are given": lambda t: t.go_to({}),
    "no vehicle has the name 0; expected one of cf1, cf2": lambda t: t[0],
    "formation: the number of places is 1; expected 2": lambda t: t.formation([(0, 0, 1)]),
    "wait is -1; expected a finite number >= 0": lambda t: t.wait(-1),
}


@pytest.mark.parametrize("text", BAD)
def test_bad_commands_are_named_and_move_no_vehicle(flying, text):
    before = [flying.position(name) for name in flying.names]
    with pytest.raises(MissionError, match=text):
        BAD[text](flying)
    assert [flying.position(name) for name in flying.names] == before


def test_a_takeoff_needs_all_of_its_way(group):
    group["cf2"].takeoff(1.0)
    group["cf2"].go_to((0.0, 0.0, 1.0))
    # Right below the other vehicle, and far enough from it at its end only.
    with pytest.raises(MissionError, match=r"cf1 and cf2 would be 0.25 m apart, 0.0 s from now"):
        group["cf1"].takeoff(1.8)
    with pytest.raises(MissionError, match=r"cf1 and cf2 would be"):
        group["cf1"].takeoff(0.5)
    group["cf1"].takeoff(0.4)
    assert group.flying == ["cf1", "cf2"]


def test_a_takeoff_goes_up():
    group = DryRun({"cf1": (0.0, 0.0, 0.7)})
    with pytest.raises(
        MissionError, match="the height is 0.75 m, and the vehicle is at 0.70 m; expected at"
    ):
        group.takeoff(0.75)
    group.takeoff(0.8)


def test_commands_on_the_ground_are_refused(group):
    with pytest.raises(MissionError, match="cf1: go_to: the vehicle is on the ground; call"):
        group["cf1"].go_to((0, 0, 1))
    with pytest.raises(MissionError, match="cf1: takeoff .* z is 3 m; expected 0 to 2 m"):
        group.takeoff(3.0)
    with pytest.raises(MissionError, match="height is nan"):
        group.takeoff(math.nan)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Bounds((1, 1, 1), (0, 0, 0)), "bounds are"),
        (lambda: Limits(speed=-1.0), "limits: speed is -1.0; expected a finite number > 0"),
        (lambda: Limits(speed="fast"), "limits: speed is 'fast'; expected a finite number > 0"),
        (
            lambda: Limits(min_thrust=12.0),
            "min_thrust is 12, and max_thrust 16; expected one below",
        ),
        (lambda: Bounds("room", (0, 0, 0)), "bounds are 'room' to"),
        (lambda: Rules(separation=-1), "separation is -1; expected a finite number >= 0"),
        (lambda: Rules(tolerance=0), "tolerance is 0; expected a finite number > 0"),
        (
            lambda: Rules(arrival_timeout=math.nan),
            "arrival_timeout is nan; expected a finite number >= 0",
        ),
        (lambda: Limits(tilt=math.nan), "limits: tilt is nan"),
    ],
)
def test_bad_rules_are_named(make, text):
    with pytest.raises(MissionError, match=text):
        make()


def test_trajectories_are_moved_and_stretched():
    pieces = stretched(moved(figure8(), (1.0, 0.0, 2.0)), 3.0)
    assert duration(pieces) == pytest.approx(30.0)
    slow, quick = pieces[3].evaluate(1.5), figure8()[3].evaluate(0.5)
    np.testing.assert_allclose(slow.position, np.add(quick.position, (1.0, 0.0, 2.0)))
    np.testing.assert_allclose(slow.velocity, np.divide(quick.velocity, 3.0))


def test_a_dry_run_warns_of_vehicles_that_fly_below_others(monkeypatch):
    warnings = []
    group = DryRun({"cf1": (0.0, 0.0, 0.0), "cf2": (1.0, 0.0, 0.0)})
    monkeypatch.setattr(group.observer, "warn", warnings.append)
    dry_run(group, lambda fleet: fleet.takeoff(1.0))
    assert warnings == []

    def stacked(fleet):
        fleet.takeoff(0.5)
        fleet.go_to({"cf2": (1.0, 0.0, 1.3)})
        fleet.go_to({"cf1": (0.97, 0.0, 0.5)})

    dry_run(group, stacked)
    (warning,) = warnings
    assert "cf1 flies below another vehicle" in warning
    assert re.search(r"at \(0\.9., 0\.00, 0\.50\) m, their downwash is 3\.. m/s", warning), warning
