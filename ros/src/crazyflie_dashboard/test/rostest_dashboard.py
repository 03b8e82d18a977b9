"""Three vehicles as a page sees and commands them: found, flown, refused, stale."""

import time
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
from pages import stopped

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.dashboard_node import example_folders
from crazyflie_dashboard.emergency import EmergencyLane
from crazyflie_dashboard.master import Master
from crazyflie_dashboard.page_data import Command
from crazyflie_dashboard.snapshot import Action, Kind
from crazyflie_utils.main import ros_process
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.testing.programs import wait_until

NAMES = ("cf1", "cf2", "cf3")
LIMIT = 30.0


@pytest.fixture(scope="module")
def dashboard():
    process = ros_process()
    handle = process.handle("/dashboard")
    master = Master("/dashboard")
    found = Dashboard(handle, master, EmergencyLane(master, handle.warn), example_folders())
    process.start()
    yield found
    found.close()
    process.stop()


@pytest.fixture(scope="module")
def page(dashboard):
    number = dashboard.pages.open(lambda text: None)
    wait_until(lambda: fresh(dashboard) == [*NAMES], "three vehicles", LIMIT)
    return number


@pytest.fixture
def operator(dashboard, page):
    dashboard.pages.take(page)
    yield page
    dashboard.pages.release(page)


def fresh(dashboard):
    return [name for name, each in dashboard.scene().vehicles.items() if not each.is_stale]


def command(dashboard, page, action, names=NAMES, **details):
    clicked = details.pop("clicked", time.monotonic())
    made = Command(action, tuple(names), clicked, **details)
    return dashboard.command(page, made).result(LIMIT)


def height(dashboard, name):
    return dashboard.scene().vehicles[name].position[2]


def test_vehicles_are_found(dashboard, page):
    vehicle = dashboard.scene().vehicles["cf2"]
    assert vehicle.kind == Kind.SIMULATED
    assert vehicle.position[2] == pytest.approx(0.0, abs=0.01)
    wait_until(lambda: dashboard.scene().vehicles["cf2"].state == "on the ground", "a state", LIMIT)
    expected = {
        Action.TAKEOFF,
        Action.LAND,
        Action.GO_TO,
        Action.HOLD,
        Action.EMERGENCY,
        Action.RESET,
    }
    assert vehicle.actions == expected


def test_a_page_without_control_only_looks(dashboard, page):
    with pytest.raises(RefusalError, match="no page has control"):
        command(dashboard, page, Action.TAKEOFF)


def test_an_old_command_is_not_carried_out(dashboard, operator):
    with pytest.raises(RefusalError, match=r"2\.\d s old; expected at most 1 s"):
        command(dashboard, operator, Action.TAKEOFF, clicked=time.monotonic() - 2.0)
    assert height(dashboard, "cf1") == pytest.approx(0.0, abs=0.01)


def test_refusals_are_the_words_of_the_service(dashboard, operator):
    refused = command(dashboard, operator, Action.GO_TO, ["cf1"], goal=(0.0, 0.0, 1.0))
    assert refused == {"cf1": "the vehicle is on the ground; expected it to fly"}


def test_vehicles_fly_and_land(dashboard, operator):
    dashboard.watch(operator, ["cf1"])
    assert command(dashboard, operator, Action.TAKEOFF) == dict.fromkeys(NAMES, "")
    wait_until(lambda: all(height(dashboard, n) > 0.9 for n in NAMES), "all up", LIMIT)
    x, y, _ = dashboard.scene().vehicles["cf1"].position
    goal = (x - 0.5, y, 1.2)
    assert command(dashboard, operator, Action.GO_TO, ["cf1"], goal=goal) == {"cf1": ""}
    wait_until(
        lambda: dashboard.scene().vehicles["cf1"].position == pytest.approx(goal, abs=0.05),
        "cf1 at its goal",
        LIMIT,
    )
    shown = {series.name: series for series in dashboard.plots(operator)["cf1"]}
    assert max(shown["position z"].values) > 1.1
    assert {"error", "velocity x", "roll", "thrust", "reference position z"} <= shown.keys()
    assert shown["thrust"].values[-1] == pytest.approx(9.81, abs=3.0)
    assert dashboard.scene().vehicles["cf1"].control_age < 1.0
    assert command(dashboard, operator, Action.LAND) == dict.fromkeys(NAMES, "")
    wait_until(lambda: all(height(dashboard, n) < 0.05 for n in NAMES), "all down", LIMIT)


def test_a_trajectory_is_rehearsed_flown_and_stopped(dashboard, operator):
    (mission,) = [each for each in dashboard.mission_files() if each.name == "figure8.csv"]
    result = dashboard.dry_run(operator, mission, ("cf2",)).result(LIMIT)
    assert result.passed, result.text
    wait_until(lambda: len(dashboard.scene().paths.get("cf2", ())) > 20, "its path", LIMIT)
    end = dashboard.fly(operator, mission, ("cf2",), time.monotonic())
    wait_until(lambda: height(dashboard, "cf2") > 0.5, "cf2 in the air", LIMIT)
    dashboard.stop_mission(operator, time.monotonic()).result(LIMIT)
    assert end.result(LIMIT) == ""
    assert height(dashboard, "cf2") < 0.1


def test_fields_of_topics_are_plotted(dashboard, page):
    # A field that is not there has no plot.
    dashboard.receive(page, ["/cf2/state/state/z", "/cf2/state/state/zz"])
    wait_until(
        lambda: any(s.times for s in dashboard.plots(page)[""] if "cf2" in s.name), limit=LIMIT
    )
    # Where it is seen: before those of the vehicle.
    assert [each.name for each in dashboard.plots(page)[""]] == ["/cf2/state/state/z"]
    dashboard.receive(page, [])
    wait_until(lambda: dashboard.plots(page)[""] == (), limit=LIMIT)


def test_live_parameters_right_and_wrong(dashboard, operator):
    assert "/cf1/takeoff_server" in dashboard.parameter_owners()
    found = dashboard.parameters("/cf1/takeoff_server").result(LIMIT)
    number = next(each for each in found if each.minimum == 0.0)
    assert number.help

    def set_to(text):
        return dashboard.set_parameter(operator, number, text).result(LIMIT)

    assert set_to(f"{number.value * 1.01:.4f}").value == pytest.approx(number.value * 1.01, 1e-3)
    for wrong, expected in (("much", "a number"), ("-1", "0 to 1 m/s")):
        with pytest.raises(RefusalError, match=f"{number.name} is .*expected .*{expected}"):
            set_to(wrong)


def pid_of(node):
    return ServerProxy(rosgraph.Master("/dashboard").lookupNode(node)).getPid("/dashboard")[2]


def test_a_takeoff_at_a_node_that_is_stopped_does_not_happen_when_it_goes_on(dashboard, operator):
    with stopped(pid_of("/fleet")):
        refused = command(dashboard, operator, Action.TAKEOFF, ["cf2"])["cf2"]
    assert "has not been reached within" in refused
    wait_until(lambda: fresh(dashboard) == [*NAMES], "fresh vehicles", LIMIT)
    # The node's work is done before a later takeoff.
    assert command(dashboard, operator, Action.TAKEOFF, ["cf3"]) == {"cf3": ""}
    wait_until(lambda: height(dashboard, "cf3") > 0.9, "cf3 up", LIMIT)
    assert height(dashboard, "cf2") < 0.05
    assert command(dashboard, operator, Action.LAND, ["cf3"]) == {"cf3": ""}


def test_an_emergency_with_a_stopped_master_stops_all_motors(dashboard, operator):
    wait_until(
        lambda: {each.state for each in dashboard.scene().vehicles.values()} == {"on the ground"},
        "all on the ground",
        LIMIT,
    )
    assert command(dashboard, operator, Action.TAKEOFF) == dict.fromkeys(NAMES, "")
    wait_until(lambda: all(height(dashboard, n) > 0.9 for n in NAMES), "all up", LIMIT)
    with stopped(rosgraph.Master("/dashboard").getPid()):
        outcomes = dashboard.emergency(None, 0.0).result(LIMIT)
        wait_until(
            lambda: all(each.is_emergency for each in dashboard.scene().vehicles.values()),
            "emergencies",
            LIMIT,
        )
        wait_until(lambda: all(height(dashboard, n) < 0.05 for n in NAMES), "all fallen", LIMIT)
    assert outcomes == dict.fromkeys(
        ("/all/emergency", *(f"/{name}/emergency" for name in NAMES)), ""
    )


def test_a_vehicle_whose_poses_stop_is_stale(dashboard, page):
    with stopped(pid_of("/fleet")):
        wait_until(lambda: fresh(dashboard) == [], "stale vehicles", LIMIT)
        assert dashboard.scene().vehicles["cf1"].pose_age > 0.5
    wait_until(lambda: fresh(dashboard) == [*NAMES], "fresh vehicles", LIMIT)


def test_without_a_page_nothing_is_received(dashboard, page):
    dashboard.pages.close(page)
    wait_until(lambda: not dashboard.scene().vehicles, "an empty scene", LIMIT)
