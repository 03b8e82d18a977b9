"""What a recorded figure eight would have been with today's nodes, and with other gains."""

import csv
import math
import re
import shutil
from pathlib import Path

import genpy
import numpy as np
import pytest
import rosbag
import rospkg
from figure_eight_flight import BAG, FOLDER, HOVER, fly, reference
from std_srvs.srv import EmptyRequest

from crazyflie_control_merger.cmd_vel_converter_node import CmdVelConverterNode
from crazyflie_msgs.msg import FlightStatus, PositionVelocityStateStamped
from crazyflie_reports.what_if import FAILED, WORSE, Options, compare, main
from crazyflie_utils import launch_file
from crazyflie_utils.journal.journal_file import Journal, JournalWriter, Kind
from crazyflie_utils.journal.recording import Recorder
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing.fake_graph import FakeGraph
from crazyflie_utils.testing.fake_process import FakeProcess
from crazyflie_utils.vectors import stamped, to_tuple

SOFT = Path(rospkg.RosPack().get_path("crazyflie_lqr")) / "config" / "K_soft.txt"
#: Of the gains of K_quadrotor.txt: columns x, y, z, x_dot, y_dot, z_dot, yaw.
SOFTER = np.array([0.6, 0.6, 0.6, 0.75, 0.75, 0.75, 1.0])
RMS = "error in flight, rms"
LAUNCH = "crazyflie_examples/sw_hover.launch"


def figures(options, out):
    """Return the figures of the only flight: name to values before and after."""
    [(_, changes)] = compare(options, out).changes
    return {each.before.name: (each.before.value, each.after.value) for each in changes}


def rms_of(bag, out):
    """Return the error of a flight (mm), which is in both columns if nothing is changed."""
    return figures(Options(bag, nodes=("lqr",)), out)[RMS][0]


def test_todays_nodes_fly_the_recorded_flight(tmp_path):
    # A test like this one belongs into the CI of a laboratory, with a flight of its own.
    status = main([str(BAG), "--out", str(tmp_path)])
    assert status == 0
    for name, (before, after) in figures(Options(BAG), tmp_path).items():
        both_unknown = math.isnan(before) and math.isnan(after)
        assert both_unknown or after == pytest.approx(before, rel=1e-3, abs=1e-3), name


def test_soft_gains_are_predicted_within_10_percent(tmp_path):
    flown = fly(tmp_path / "soft.bag", K_file=SOFT)
    asked = Options(BAG, {"lqr_controller/K_file": str(SOFT)}, is_closed=True, model="near_hover")
    before, predicted = figures(asked, tmp_path / "what_if")[RMS]
    really = rms_of(flown, tmp_path / "really")
    assert predicted == pytest.approx(really, rel=0.1)
    assert really > 1.5 * before


def test_warnings_of_the_other_flight_are_its_events(tmp_path):
    limit = ["--set", "lqr_controller/reference/max_jump=0.1"]
    assert main([str(BAG), "--out", str(tmp_path), *limit]) == 0
    with (tmp_path / "events.csv").open() as file:
        events = [row for row in csv.DictReader(file) if row["recording"] == "what if"]
    texts = [event["text"] for event in events if event["kind"] == "warning"]
    assert any(
        "/lqr_controller" in text and "flying 0.1 m in its direction" in text for text in texts
    )


def gusts(process):
    """Let the wind blow in the simulator."""
    process.reconfigure("/simulator", **{"wind/x": 0.8, "wind/gust": 0.4})


# A quick one is test_soft_gains_are_predicted_within_10_percent.
@pytest.mark.long
@pytest.mark.parametrize("weather", [None, gusts], ids=["calm", "gusts"])
def test_a_quadrotor_is_predicted_within_10_percent(tmp_path, weather):
    # With motors, inner loops and drag, which the identified model of first order does not have.
    gains = tmp_path / "K.txt"
    np.savetxt(gains, SOFTER * np.loadtxt(SOFT.with_name("K_quadrotor.txt")))
    recorded, really = (
        fly(tmp_path / f"{name}.bag", prepare=weather, dynamics="quadrotor", **more)
        for name, more in (("recorded", {}), ("really", {"K_file": gains}))
    )
    launch = LAUNCH, "dynamics:=quadrotor"
    asked = Options(recorded, {"lqr_controller/K_file": str(gains)}, is_closed=True, launch=launch)
    before, predicted = figures(asked, tmp_path / "what_if")[RMS]
    flown = rms_of(really, tmp_path / "flown")
    assert predicted == pytest.approx(flown, rel=0.1)
    assert abs(flown - before) > 0.2 * before


def test_a_driven_vehicle_flies_by_the_commands_of_the_converter(tmp_path):
    def drive(process):
        topics = {"topics/control": "/control/final", "topics/cmd_vel": "/crazyflie/cmd_vel"}
        assert process.launch(CmdVelConverterNode(), "/cmd_vel_converter", topics)

    recorded = fly(tmp_path / "driven.bag", prepare=drive)
    asked = Options(recorded, is_closed=True, model="cf21")
    result = compare(asked, tmp_path / "out")
    # Nodes and parameters are those of hw_hover.launch, whose gains are others.
    remarks = result.report.recordings[1]["remarks"]
    assert "cmd_vel_converter" in remarks[0]
    assert any("/crazyflie/connected was not recorded" in each for each in remarks)
    [(_, changes)] = result.changes
    [(before, after)] = [(c.before.value, c.after.value) for c in changes if c.before.name == RMS]
    assert before < after < 200.0


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("state_estimator/frames/fixed=moon", "/state_estimator has published no state: "),
        ("takeoff_server/topics/connected=/connected", "the nodes do not fly: /takeoff: "),
    ],
)
def test_nodes_that_do_not_fly_say_why(change, text, tmp_path, capsys):
    assert main([str(BAG), "--set", change, "--out", str(tmp_path)]) == FAILED
    assert text in capsys.readouterr().err


def test_a_figure_that_gets_worse_than_normal_is_the_exit_status(tmp_path, capsys):
    gains = f"lqr_controller/K_file={SOFT}"
    loop = ["--closed", "--type", "near_hover"]
    assert main([str(BAG), "--set", gains, *loop, "--out", str(tmp_path)]) == WORSE
    printed = capsys.readouterr().out
    assert "hover error, maximum" in printed
    assert "worse than normal: ≤ 10 mm" in printed
    page = (tmp_path / "report.html").read_text()
    for name in ("x what if", "x recorded", "distance what if"):
        assert f'"{name}"' in page


def test_a_part_of_a_flight_is_flown_by_the_model(tmp_path):
    asked = Options(BAG, is_closed=True, model="near_hover", begin=14.0, end=18.0)
    compare(asked, tmp_path)
    with rosbag.Bag(str(BAG)) as then, rosbag.Bag(str(tmp_path / "what_if.bag")) as now:
        states = [
            {round(m.header.stamp.to_sec(), 3): m.state for _, m, _ in bag.read_messages("/state")}
            for bag in (then, now)
        ]
        start = then.get_start_time()
    common = sorted(set(states[0]) & set(states[1]))
    assert common[-1] == pytest.approx(start + 18.0, abs=0.03)
    # Before it nothing differs; in it, the model drifts by the difference from the simulator.
    for time in common:
        there, here = (math.hypot(s[time].x, s[time].y) for s in states)
        assert here == pytest.approx(there, abs=1e-12 if time < start + 14.0 else 2e-3)
    assert any(states[0][time] != states[1][time] for time in common)


@pytest.fixture(scope="module")
def journals(tmp_path_factory):
    """Return the folder of the journals of a figure eight, by five processes, and its states."""
    folder = tmp_path_factory.mktemp("journals")
    _, parameters = launch_file.expand(
        FOLDER / "launch" / "sw_hover.launch", composed="true", rviz="false", simulator_dt=0.01
    )

    def recorder(process, time):
        header = {"node": process, "program": "", "clock": "manual", "start": time, "us": 0}
        return Recorder(JournalWriter(folder / f"{process[1:]}.journal", header, 1e9, print))

    graph = FakeGraph(parameters, recorder=recorder)
    status, states = [FlightStatus.UNKNOWN], []
    graph.listen("/in_flight_flight_status", lambda message: status.append(message.state))
    graph.listen("/state", states.append)
    classes = NODE_CLASSES(launch_file.composed_nodes(parameters))
    for name, node in classes.items():
        graph.start(f"/{name}", node())

    def advance_until(state):
        for _ in range(100):
            graph.advance(0.1)
            if status[-1] == state:
                return
        pytest.fail(f"the flight is not in the state {state}")

    graph.advance(1.0)
    graph.call("/takeoff", EmptyRequest())
    advance_until(FlightStatus.FLYING)
    graph.advance(HOVER)
    for step in range(200):
        state = reference(0.05 * step)
        message = stamped(PositionVelocityStateStamped, graph.stamp(), state=state)
        graph.publish("/ref", message, "/figure_eight")
        graph.advance(0.05)
    graph.call("/land", EmptyRequest())
    advance_until(FlightStatus.ON_GROUND)
    graph.advance(1.0)
    for name in classes:
        graph.kill(f"/{name}")
    return folder, states


def test_a_folder_of_journals_is_run_again(journals, tmp_path):
    folder, states = journals
    only = ("estimator", "lqr", "takeoff")
    assert main([str(folder), "--nodes", ",".join(only), "--out", str(tmp_path)]) == 0
    with rosbag.Bag(str(tmp_path / "what_if.bag")) as bag:
        again = [message.state for _, message, _ in bag.read_messages("/state")]
    assert len(again) == pytest.approx(len(states), abs=3)
    before, after = figures(Options(folder, nodes=only), tmp_path)[RMS]
    # Here all processes do everything at the same moments; which one was first is not known.
    assert after == pytest.approx(before, rel=0.1)
    assert before > 5.0


def test_a_process_is_run_again_in_the_recorded_order(tmp_path):
    path = tmp_path / "hover.journal"
    _, parameters = launch_file.expand(
        FOLDER / "launch" / "sw_hover.launch", composed="true", rviz="false"
    )
    header = {"node": "/hover", "program": "", "clock": "manual", "start": 0.0, "us": 0}
    recorder = Recorder(JournalWriter(path, header, 1e9, print))
    process = FakeProcess(parameters, 0.0, recorder=recorder)
    with rosbag.Bag(str(BAG)) as bag:
        start = process.clock.wall_offset = bag.get_start_time()
    classes = NODE_CLASSES(launch_file.composed_nodes(parameters))
    for name in ("state_estimator", "lqr_controller", "takeoff_server", "takeoff_control_filter"):
        assert process.launch(classes[name](), f"/{name}")
    takeoff = None
    with rosbag.Bag(str(BAG)) as bag:
        for topic, message, time in bag.read_messages(["/tf", "/ref"]):
            process.advance(max(0.0, time.to_sec() - start - process.clock.time()))
            process.publish(topic, message)
            if takeoff is None and process.clock.time() >= 1.0:
                takeoff = process.call("/takeoff", EmptyRequest())
    recorder.close()
    assert main([str(path), "--out", str(tmp_path / "out")]) in (0, WORSE)
    with rosbag.Bag(str(tmp_path / "out" / "what_if.bag")) as bag:
        for topic in ("/state", "/control/lqr", "/control/final"):
            again = {m.header.stamp: m for _, m, _ in bag.read_messages(topic)}
            then = {m.header.stamp: m for m in process.published(topic)}
            common = set(again) & set(then)
            assert len(common) > 0.95 * len(then) > 1000
            for stamp in common:
                values = (
                    m.state if topic == "/state" else m.control for m in (again[stamp], then[stamp])
                )
                assert to_tuple(next(values)) == pytest.approx(to_tuple(next(values)), abs=1e-6)


def test_a_model_flies_in_journals(journals, tmp_path):
    gains = {"lqr_controller/K_file": str(SOFT)}
    asked = Options(journals[0], gains, is_closed=True, model="near_hover")
    before, after = figures(asked, tmp_path)[RMS]
    assert 1.3 * before < after < 3.0 * before


def test_other_gains_in_journals_are_laid_over(journals, tmp_path):
    gains = {"lqr_controller/K_file": str(SOFT)}
    result = compare(Options(journals[0], gains, nodes=("lqr",)), tmp_path)
    [flight] = result.report.recordings[0]["flights"]
    plots = {each["title"]: each["curves"] for each in flight["plots"]}
    curves = {each["name"]: each["v"] for each in plots["/control/lqr: attitude"]}
    largest, softer = (
        max(abs(v) for v in curves[name] if v is not None) for name in ("roll", "roll what if")
    )
    assert largest > 1.2 * softer > 0.0


def test_a_cut_journal_is_read_to_the_damage(journals, tmp_path, capsys):
    folder = tmp_path / "cut"
    shutil.copytree(journals[0], folder)
    path = folder / "lqr_controller.journal"
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3])
    main([str(folder), "--nodes", "estimator", "--out", str(tmp_path / "out")])
    assert "lqr_controller.journal is read to where" in capsys.readouterr().out


def test_a_journal_whose_class_is_gone_is_no_success(journals, tmp_path, capsys):
    rows = Journal(journals[0] / "lqr_controller.journal").rows()
    path = tmp_path / "gone.journal"
    program = "crazyflie_lqr.lqr_nodes:GoneNode"
    header = {"node": "/lqr_controller", "program": program, "clock": "steady", "us": 0}
    writer = JournalWriter(path, header, 1e9, print)
    for row in rows:
        # The class is not in any row of a process with ROS.
        if row.kind is not Kind.LAUNCH:
            writer.row(row.kind, row.number, row.value, row.data)
    writer.close()
    assert main([str(path), "--out", str(tmp_path / "out")]) == FAILED
    error = capsys.readouterr().err
    assert "has no node that can be run again" in error
    assert f"there is no {program} any more" in error


def without(path, *topics):
    """Return a copy of the recorded flight without some topics."""
    with rosbag.Bag(str(BAG)) as bag, rosbag.Bag(str(path), "w") as left:
        for topic, message, time in bag.read_messages():
            if topic not in topics:
                left.write(topic, message, time)
    return path


BAD = {
    "nodes": (
        ["--nodes", "estimator,pilot"],
        "--nodes pilot: no such node; expected of .*/lqr_cont",
    ),
    "node": (
        ["--set", "pilot/gain=1"],
        "--set pilot/gain: no such node; expected one of .*/lqr_con",
    ),
    "parameter": (
        ["--set", "lqr_controller/K_fil=1"],
        "lqr_controller reads no such parameter; expected one of .*K_file, .*integrator/k/x",
    ),
    "value": (
        ["--set", "state_estimator/time_step=-1"],
        "parameter /state_estimator/time_step is -1; expected",
    ),
    "file": (["--set", "lqr_controller/K_file=/no.txt"], "/lqr_controller/K_file.*/no.txt"),
    "not chosen": (
        ["--nodes", "lqr", "--set", "state_estimator/time_step=0.02"],
        "/state_estimator is not among --nodes lqr",
    ),
    "type": (["--closed", "--type", "boeing"], "the model boeing does not exist; expected one of"),
    "launch": (["--launch", "crazyflie_examples/no.launch"], "no.launch cannot be read"),
    "argument": (
        ["--launch", "crazyflie_examples/sw_hover.launch", "dynamic:=quadrotor"],
        "sw_hover.launch has no argument dynamic; did you mean dynamics?",
    ),
    "no control": (["--closed", "--nodes", "estimator,lqr"], "needs a node that publishes control"),
    "times": (["--from", "9", "--to", "3"], "--from 9.0 is not before --to 3"),
    "vehicle": (["--vehicle", "cf7"], "--vehicle cf7: expected one of"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_asked_is_named(name, tmp_path, capsys):
    arguments, text = BAD[name]
    assert main([str(BAG), *arguments, "--out", str(tmp_path)]) == FAILED
    error = capsys.readouterr().err
    assert error.startswith("what_if: ")
    assert re.search(text, error), error


@pytest.mark.parametrize(
    ("topics", "arguments", "text"),
    [
        (["/tf"], [], "does not have /tf (tf2_msgs/TFMessage), which /state_estimator reads"),
        (["/state"], ["--nodes", "lqr"], "does not have /state (crazyflie_msgs/Position"),
        (["/ref"], ["--nodes", "lqr"], "does not have /ref (crazyflie_msgs/Position"),
    ],
)
def test_missing_topics_are_named(topics, arguments, text, tmp_path, capsys):
    bag = without(tmp_path / "part.bag", *topics)
    assert main([str(bag), *arguments, "--out", str(tmp_path / "out")]) == FAILED
    assert text in capsys.readouterr().err


def test_another_frame_on_tf_is_found(tmp_path):
    bag = tmp_path / "other.bag"
    with rosbag.Bag(str(BAG)) as old, rosbag.Bag(str(bag), "w") as new:
        for topic, message, time in old.read_messages():
            for transform in message.transforms if topic == "/tf" else ():
                transform.child_frame_id = "cf9"
            new.write(topic, message, genpy.Time(time.secs, time.nsecs))
    before, after = figures(Options(bag), tmp_path / "out")[RMS]
    assert after == pytest.approx(before, rel=1e-3)
