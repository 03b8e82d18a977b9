"""Reports on bags of flights that are known in closed form."""

import csv
import json
import re

import bags
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import String

from crazyflie_msgs.msg import VehicleStatus
from crazyflie_reports.bag_events import EventLog, Kind


def values(flight):
    """Return the figures of a flight of report.json by name."""
    return {name: each["value"] for name, each in flight["figures"].items()}


def page(folder):
    """Return the page and the data in it."""
    html = (folder / "out" / "report.html").read_text()
    return html, json.loads(re.search(r'application/json">(.*)</script>\n<script>', html)[1])


EXPECTED = {
    "time to hover": 1.98,
    "overshoot": 1e3 * bags.OFFSET,
    "hover error, maximum": 1e3 * bags.OFFSET,
    "error in flight, rms": 1e3 * bags.OFFSET,
    "error in flight, 95 %": 1e3 * bags.OFFSET,
    "error in flight, maximum": 1e3 * bags.OFFSET,
    "touchdown speed": bags.SINK,
    "duration": bags.LANDED - bags.TAKEOFF,
    "height, maximum": 1.0 + bags.OFFSET,
    "speed, maximum": bags.SPEED,
    # Constant thrust, until the last control in flight.
    "thrust used, as time of hover": bags.LANDED - bags.TAKEOFF,
    "delay pose to control, median": 1e3 * bags.DELAY,
    "state rate": 100.0,
    "control rate": 100.0,
    "state gap, longest": 10.0,
    "states not recorded": 0.0,
    "roll and pitch, mean change per control": 0.0,
    "controls saturated": 0.0,
}


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
@pytest.mark.parametrize("is_typed", [True, False])
def test_figures(run, compression, is_typed):
    bag = bags.flight_bag(run.folder / "a.bag", compression, is_typed=is_typed)
    status, _, (flight,) = run(bag)
    assert status == 0
    found = values(flight)
    for name, value in EXPECTED.items():
        assert found[name] == pytest.approx(value, rel=0.01, abs=0.01), name
    assert found["battery, lowest"] is None
    phases = page(run.folder)[1]["recordings"][0]["flights"][0]["phases"]
    assert [each[0] for each in phases] == ["taking off", "flying", "landing"]
    assert phases[1][1] == pytest.approx(bags.FLYING - bags.TAKEOFF, abs=0.01)


def test_the_drift_of_an_estimate_is_shown(run):
    _, _, (flight,) = run(bags.flight_bag(run.folder / "a.bag", drift=0.02))
    drift = flight["figures"]["drift of the estimate, maximum"]
    assert drift["value"] == pytest.approx(20.0 * bags.LANDED, abs=1.0)


@pytest.mark.parametrize(("lateness", "is_normal"), [(0.15, True), (0.35, False)])
def test_a_vehicle_that_is_later_than_its_model_is_said_to_be(run, lateness, is_normal):
    _, _, (flight,) = run(bags.flight_bag(run.folder / "a.bag", lateness=lateness))
    late = flight["figures"]["roll and pitch behind their commands"]
    assert late["value"] == pytest.approx(1e3 * (lateness - bags.DELAY), abs=10.0)
    assert late["normal"] == "≤ 250 ms"
    with (run.folder / "out" / "figures.csv").open() as file:
        rows = {each["figure"]: each for each in csv.DictReader(file)}
    assert rows["roll and pitch behind their commands"]["is normal"] == str(is_normal)
    # Nothing is said about a figure that is not known.
    assert rows["battery, lowest"]["value"] == rows["battery, lowest"]["is normal"] == ""


def test_restless_controls_are_not_normal(run):
    bag = bags.flight_bag(run.folder / "a.bag", tilt=0.2618)
    status, printed, (flight,) = run(bag)
    assert status == 0
    found = values(flight)
    # Roll jumps from one limit to the other with each control, pitch stays.
    assert found["roll and pitch, mean change per control"] == pytest.approx(0.2618, rel=1e-3)
    assert found["controls saturated"] == pytest.approx(100.0)
    assert "mean change per control 0.2618 rad (≤ 0.01 rad)" in printed
    assert "controls saturated 100 % (≤ 1 %)" in printed


def test_a_gap(run):
    status, output, (flight,) = run(bags.flight_bag(run.folder / "a.bag", gap=(6.0, 6.2)))
    assert status == 0
    assert values(flight)["state gap, longest"] == pytest.approx(200.0, abs=1.0)
    assert values(flight)["states not recorded"] == 19
    assert "state gap, longest 200 ms (≤ 100 ms)" in output


def test_a_gap_is_not_interpolated(run):
    run(bags.flight_bag(run.folder / "a.bag", gap=(2.0, 6.0)))
    (flight,) = page(run.folder)[1]["recordings"][0]["flights"]
    (z,) = [each for each in flight["plots"][0]["curves"] if each["name"] == "z"]
    assert [value for time, value in zip(z["t"], z["v"], strict=True) if 1.01 < time < 4.99] == [
        None
    ]
    assert len([value for value in z["v"] if value is None]) == 1
    path = flight["path"]
    at = {path["start"] + k * path["period"]: row for k, row in enumerate(path["rows"])}
    assert {row is None for time, row in at.items() if 1.01 < time < 4.99} == {True}
    assert {row is None for time, row in at.items() if not 0.99 < time < 5.01} == {False}
    # Controls are as frequent as states here, a reference is one until the next.
    curves = {c["name"]: c["v"] for plot in flight["plots"] for c in plot["curves"]}
    assert None in curves["thrust"]
    assert None not in curves["z reference"]


def test_no_velocity_is_known_of_a_pose_between_two_gaps(run):
    with bags.written(run.folder / "a.bag") as bag:
        for time, x in [*((0.01 * k, 0.0) for k in range(200)), (2.5, 5.0),
                        *((3.0 + 0.01 * k, 10.0) for k in range(200))]:  # fmt: skip
            pose = bags.PoseStamped(header=bags.header(time))
            pose.pose.position.x, pose.pose.position.z = x, 1.0 if 1.0 < time < 4.0 else 0.0
            pose.pose.orientation.w = 1.0
            bag.write("/cf1/pose", pose, bags.stamp(time))
    _, _, (flight,) = run(run.folder / "a.bag")
    (recorded,) = page(run.folder)[1]["recordings"][0]["flights"]
    (x_dot,) = [c for p in recorded["plots"] for c in p["curves"] if c["name"] == "x_dot"]
    assert {value for value in x_dot["v"] if value is not None} == {0.0}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("has_states", [False, True])
@pytest.mark.parametrize("beyond", [float("-inf"), float("inf"), float("nan")])
def test_an_infinite_pose_is_no_ground(run, has_states, beyond):
    with bags.written(run.folder / "a.bag") as bag:
        for number, time in bags.steps():
            z = beyond if number == 30 else bags.height(time)[0]
            pose = bags.PoseStamped(header=bags.header(time, number))
            pose.pose.position.z = z
            pose.pose.orientation.w = 1.0
            state = bags.PositionVelocityYawState(z=z)
            message = bags.PositionVelocityYawStateStamped(pose.header, state)
            topic = ("/cf1/state", message) if has_states else ("/cf1/pose", pose)
            bag.write(*topic, bags.stamp(time))
    _, _, (flight,) = run(run.folder / "a.bag")
    # In flight from 0.1 m on.
    begin = bags.TAKEOFF + 0.1 / bags.SPEED
    end = bags.LAND + (1.0 + bags.OFFSET - 0.1) / bags.SINK
    assert values(flight)["duration"] == pytest.approx(end - begin, abs=0.03)


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_number_that_is_too_large_to_be_rounded_is_left_out(run, monkeypatch):
    monkeypatch.setattr(bags, "START", 1.7e9)
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_flight(bag)
        state = bags.PositionVelocityYawState(z=1e306, z_dot=1e306)
        message = bags.PositionVelocityYawStateStamped(header=bags.header(5.0), state=state)
        bag.write("/state", message, bags.stamp(5.005))
    status, _, (flight,) = run(run.folder / "a.bag")
    assert status == 0
    assert values(flight)["height, maximum"] == 1e306
    (recorded,) = page(run.folder)[1]["recordings"][0]["flights"]
    (z,) = [each for each in recorded["plots"][0]["curves"] if each["name"] == "z"]
    assert max(each for each in z["v"] if each is not None) == pytest.approx(1.0 + bags.OFFSET)


def test_a_flight_with_one_state(run):
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_flight(bag, gap=(-1.0, 99.0))
        for time in (1.0, 2.0, 3.0):
            control = bags.ControlStamped(bags.header(time), bags.Control(thrust=9.81))
            bag.write("/control/final", control, bags.stamp(time))
        state = bags.PositionVelocityYawState(z=0.5)
        message = bags.PositionVelocityYawStateStamped(header=bags.header(2.0), state=state)
        bag.write("/state", message, bags.stamp(2.0))
    status, _, (flight,) = run(run.folder / "a.bag")
    assert status == 0
    assert values(flight)["height, maximum"] == pytest.approx(0.5)
    (recorded,) = page(run.folder)[1]["recordings"][0]["flights"]
    assert [row[:3] for row in recorded["path"]["rows"]] == [[0.0, 0.0, 0.5]]


def test_simulated_time_that_starts_again_begins_another_recording(run):
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_flight(bag)
        bags.write_flight(bag, tilt=0.1)
    status, _, flights = run(run.folder / "a.bag")
    assert status == 0
    assert [each["recording"] for each in flights] == [
        "a.bag, start 1 of 2", "a.bag, start 2 of 2",
    ]  # fmt: skip
    first, second = (values(each) for each in flights)
    assert first["state rate"] == second["state rate"] == pytest.approx(100.0, rel=0.01)
    assert first["tilt commanded, maximum"] == 0.0
    assert second["tilt commanded, maximum"] == pytest.approx(5.73, abs=0.01)


def test_bags_that_were_merged_out_of_order_are_one_recording_in_real_time(run, monkeypatch):
    monkeypatch.setattr(bags, "START", 1.7e9)
    with bags.written(run.folder / "a.bag") as bag:
        for begin, end in ((7.0, 99.0), (-1.0, 7.0)):
            for number, time in bags.steps():
                if begin <= time < end:
                    state = bags.PositionVelocityYawState(z=bags.height(time)[0])
                    header = bags.header(time, number)
                    message = bags.PositionVelocityYawStateStamped(header=header, state=state)
                    bag.write("/state", message, bags.stamp(time))
    _, _, (flight,) = run(run.folder / "a.bag")
    assert flight["recording"] == "a.bag"
    assert values(flight)["state rate"] == pytest.approx(100.0, rel=0.01)


def test_no_cell_of_a_table_is_a_formula(run):
    with bags.written(run.folder / "=1+1.bag") as bag:
        bags.write_flight(bag, "@a")
        bags.write_events(bag, "@a")
    run(run.folder / "=1+1.bag")
    for name in ("figures.csv", "events.csv"):
        with (run.folder / "out" / name).open() as file:
            rows = list(csv.reader(file))[1:]
        assert {row[0] for row in rows} == {"'=1+1.bag"}
        assert {row[1] for row in rows} == {"'@a"}
        cells = [cell for row in rows for cell in row]
        assert not [c for c in cells if re.match(r"[=+@\t\r]|-(?![\d.]+$)", c)]


def test_states_that_stop_in_flight(run):
    _, _, (flight,) = run(bags.flight_bag(run.folder / "a.bag", gap=(6.0, 99.0)))
    assert values(flight)["state gap, longest"] == pytest.approx(7000.0, abs=20.0)
    assert values(flight)["touchdown speed"] is None


@pytest.mark.parametrize("has_pose", [True, False])
def test_crazyflie_ros(run, has_pose):
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_driven(bag, has_pose=has_pose)
    status, _, (flight,) = run(run.folder / "a.bag")
    assert status == 0
    assert flight["vehicle"] == "cf1"
    found = values(flight)
    assert found["thrust, mean"] == pytest.approx(9.81, rel=0.01)
    assert found["tilt commanded, maximum"] == pytest.approx(2.0)
    assert found["error in flight, 95 %"] == pytest.approx(1000.0, rel=0.05)  # With the climb.
    assert found["delay pose to control, median"] == pytest.approx(1e3 * bags.DELAY, abs=0.1)
    assert found["battery, lowest"] == pytest.approx(3.9)
    assert found["speed, maximum"] == pytest.approx(bags.SPEED, rel=0.01)


def test_events_of_each_vehicle(run):
    with bags.written(run.folder / "a.bag") as bag:
        for name in ("cf1", "cf2"):
            bags.write_flight(bag, name)
        bags.write_events(bag, "cf2")
        log = bags.Log(header=bags.header(8.0), level=4, name="/fleet", msg="/cf2: is held")
        bag.write("/rosout", log, bags.stamp(8.0))
    status, _, flights = run(run.folder / "a.bag")
    assert status == 0
    assert [each["vehicle"] for each in flights] == ["cf1", "cf2"]
    assert flights[0]["events"] == []
    events = [(time, kind, text) for time, kind, text, _ in flights[1]["events"]]
    assert events == [
        (4.0, "refusal", "/cf2/node: /cf2/go refused: too far"),
        (5.1, "pose rejected", "a pose is too far away (/cf2/state_estimator: poses)"),
        (5.2, "parameter", "/cf2/lqr_controller/gain is now 2.0"),
        (5.3, "hold", "the filter is holding: no control"),
        (6.3, "emergency", "the filter is emergency: no control"),
        (7.0, "warning", "/cf2: is held"),
    ]
    with (run.folder / "out" / "events.csv").open() as file:
        assert [row["kind"] for row in csv.DictReader(file)] == [kind for _, kind, _ in events]


def test_the_page_needs_nothing_else_and_shows_names_as_text(run):
    name = "<script>alert(1)</script>"
    status, _, _ = run(bags.flight_bag(run.folder / "a.bag", name=name))
    assert status == 0
    html, data = page(run.folder)
    (flight,) = data["recordings"][0]["flights"]
    assert flight["vehicle"] == name
    assert name not in html
    assert not re.search(r"https?:|\bsrc=|\bhref=|innerHTML|{{", html)
    assert [each["title"] for each in flight["plots"]] == [
        "position", "distance from the reference", "velocity", "attitude", "thrust",
    ]  # fmt: skip
    assert len(flight["figures"]) == len(data["figures"])
    # The replay is where the vehicle was.
    path = flight["path"]
    row = path["rows"][round((5.0 - path["start"]) / path["period"])]
    assert row[:3] == pytest.approx([0.0, 0.0, 1.0 + bags.OFFSET])


def test_a_mission_that_goes_on_at_once_has_no_hover(run):
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_flight(bag)
        for number in range(400):
            time = bags.FLYING + 0.01 * number
            state = bags.PositionVelocityState(x=0.005 * number, z=1.0)
            reference = bags.PositionVelocityStateStamped(bags.header(time), state)
            bag.write("/ref", reference, bags.stamp(time))
    _, output, (flight,) = run(run.folder / "a.bag")
    found = values(flight)
    names = ("time to hover", "overshoot", "hover error, mean", "hover error, maximum")
    assert [found[name] for name in names] == [None] * 4
    assert "hover" not in output


def test_the_end_of_the_climb_is_no_error_of_the_hover(run, monkeypatch):
    """The flight begins 0.1 m below its height, which is reached in time, and has 5 s."""
    monkeypatch.setattr(bags, "SPEED", 0.3)
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_flight(bag)
    _, output, (flight,) = run(run.folder / "a.bag")
    assert values(flight)["time to hover"] == pytest.approx(3.3, abs=0.05)
    assert values(flight)["hover error, maximum"] < 10.0
    assert "normal" in output


def test_other_topics_and_other_names(run):
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_flight(bag, "a/b")
        for time in range(10):
            bag.write("/camera/image", String("no flight"), bags.stamp(time))
    assert run(run.folder / "a.bag")[2][0]["vehicle"] == "a/b"
    for wrong in ("height=/z", "state", "state=(", "state="):
        with pytest.raises(SystemExit):
            run(run.folder / "a.bag", "--topic", wrong)
    status, output, flights = run(run.folder / "a.bag", "--topic", "state=estimate")
    assert status == 0
    assert values(flights[0])["state rate"] is None


class NamesAtTheEnd:
    """A bag whose vehicles are told apart by their names at the end of topics."""

    def __init__(self, bag):
        self._bag = bag

    def write(self, topic, message, time):
        _, name, own = topic.split("/", 2)
        stem = re.match("in_flight|.*", own)[0]
        self._bag.write(f"/{stem}{name}{own.removeprefix(stem)}", message, time)


@pytest.mark.parametrize("is_typed", [True, False])
def test_vehicles_by_remapped_topics(run, is_typed):
    with bags.written(run.folder / "a.bag") as bag:
        for name in ("HY4", "HY5"):
            bags.write_flight(NamesAtTheEnd(bag), name, is_typed=is_typed)
    _, _, flights = run(run.folder / "a.bag")
    assert [each["vehicle"] for each in flights] == ["HY4", "HY5"]
    for flight in flights:
        assert [name for name, _, _ in flight["phases"]] == ["taking off", "flying", "landing"]
        assert values(flight)["overshoot"] == pytest.approx(1e3 * bags.OFFSET)


def test_other_states_and_references_are_no_vehicles(run):
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_flight(bag)
        for topic in ("/state2", "/state_smooth"):
            bag.write(topic, bags.PositionVelocityYawStateStamped(), bags.stamp(5.0))
        bag.write("/ref_descent", bags.PositionVelocityStateStamped(), bags.stamp(5.0))
    assert [each["vehicle"] for each in run(run.folder / "a.bag")[2]] == ["vehicle"]


def test_recordings_side_by_side_of_which_one_is_bad(run):
    good = bags.flight_bag(run.folder / "good.bag")
    folder = run.folder / "split"
    folder.mkdir()
    (run.folder / "good.d").mkdir()
    same = bags.flight_bag(run.folder / "good.d" / "good.bag")
    for number, name in enumerate(("a", "b")):
        bags.flight_bag(folder / f"flight_{number}.bag", name=name)
    status, output, flights = run(good, run.folder / "missing.bag", folder, same)
    assert status == 1
    assert "missing.bag does not exist; expected a bag" in output
    assert [(each["recording"], each["vehicle"]) for each in flights] == [
        (str(good), "vehicle"), ("split", "a"), ("split", "b"), (str(same), "vehicle"),
    ]  # fmt: skip
    assert [name for name, _, _ in flights[0]["phases"]] == ["taking off", "flying", "landing"]


def test_a_recording_in_the_present_folder_has_its_name(run, monkeypatch):
    bags.flight_bag(run.folder / "a.bag")
    (run.folder / "b").mkdir()
    for here, given in ((run.folder, "."), (run.folder / "b", "..")):
        monkeypatch.chdir(here)
        status, output, flights = run(given, "--mcap")
        assert (status, [each["recording"] for each in flights]) == (0, [run.folder.name])
        assert f"mcap/{run.folder.name}/{run.folder.name}.mcap" in output


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a.db3"])
def test_a_bag_that_cannot_be_opened_does_not_stop_the_others(run, name):
    good = bags.flight_bag(run.folder / "good.bag")
    (run.folder / "bad").mkdir()
    (run.folder / "bad" / name).symlink_to("nowhere")
    status, output, flights = run(run.folder / "bad", good)
    assert (status, [each["recording"] for each in flights]) == (1, ["good.bag"])
    assert f"bad/{name}: No such file or directory" in output
    assert "written" not in output


def test_no_flight(run):
    with bags.written(run.folder / "a.bag") as bag:
        for _, time in bags.steps():
            bag.write("/control/final", bags.ControlStamped(), bags.stamp(time))
        bags.write_events(bag)
    status, output, flights = run(run.folder / "a.bag")
    assert (status, flights) == (0, [])
    assert "It has no flight." in output
    assert "5.0 s: refusal: /node: /go refused: too far" in output


@pytest.mark.parametrize(("x", "time"), [(5.0, None), (float("inf"), 1.98)])
def test_references_that_are_far_or_infinite(run, x, time):
    with bags.written(run.folder / "a.bag") as bag:
        bags.write_flight(bag)
        state = bags.PositionVelocityState(x=x)
        bag.write("/ref", bags.PositionVelocityStateStamped(bags.header(2.0), state), bags.stamp(2))
    status, output, (flight,) = run(run.folder / "a.bag")
    assert status == 0
    assert values(flight)["time to hover"] == (time and pytest.approx(time, abs=0.02))
    assert "inf" not in output
    assert ("hover error" in output) == (time is None)
    text = (run.folder / "out" / "report.json").read_text()
    assert not re.search("Infinity|NaN", text)
    with (run.folder / "out" / "figures.csv").open() as file:
        values_of = {row["figure"]: row["value"] for row in csv.DictReader(file)}
    assert (values_of["time to hover"] == "") == (time is None)


def test_a_vehicle_that_cannot_fly_is_an_event_once():
    log = EventLog()
    for time, bits in enumerate((0x0E, 0x840, 0x840, 0x0E)):
        status = VehicleStatus(supervisor=bits)
        log.add(time, "/cf1/vehicle_status", "cf1", "crazyflie_msgs/VehicleStatus", status)
    (event,) = log.events
    assert (event.time, event.kind) == (1, Kind.ERROR)
    assert event.text == "the vehicle cannot fly: locked, deck fault"


def test_a_fence_that_is_not_certain_is_a_warning_of_its_vehicle_once():
    log = EventLog()
    text = "the box is not certain: disturbance along x 0.9 m/s^2, bound 0.6"
    for time, level in enumerate((DiagnosticStatus.OK, *[DiagnosticStatus.WARN] * 3)):
        status = DiagnosticStatus(level, "cf1/geofence: certificate", text if level else "", "", [])
        message = DiagnosticArray(status=[status])
        log.add(time, "/diagnostics", "", "diagnostic_msgs/DiagnosticArray", message)
    (event,) = log.events
    assert (event.time, event.kind, event.namespace) == (1, Kind.WARNING, "cf1")
    assert event.text == f"cf1/geofence: certificate: {text}"
