"""The runner of missions: dry runs and flights of scripts and trajectories on a fake process."""

import io
import json
import sys

import pytest
from fake_fleet import fake_process
from fake_vehicles import ControllerVehicle

from crazyflie_demo import trajectory_file
from crazyflie_demo.figure8 import figure8
from crazyflie_mission_api import DryRun, MissionError, fleet, observer
from crazyflie_mission_api.mission_runner import main
from crazyflie_mission_api.observer import MissionObserver

SCRIPT = """
import sys
from crazyflie_mission_api import Fleet
from goals import GOAL

def mission(fleet):
    fleet.takeoff(1.0)
    fleet["cf1"].go_to(GOAL)
    fleet.formation([GOAL])

with Fleet(sys.argv[1:]) as fleet:
    {}
"""


@pytest.fixture
def vehicle(monkeypatch):
    """Return the vehicle of a process that scripts find."""
    process = fake_process(monkeypatch)
    monkeypatch.setattr(fleet, "begin_script", lambda *_: (process, lambda: None))
    monkeypatch.setattr(fleet, "catch_signals", lambda _: None)
    monkeypatch.setattr(observer, "of_process", MissionObserver())
    monkeypatch.setattr("sys.argv", [])
    monkeypatch.setattr("sys.path", ["", *sys.path])
    return ControllerVehicle(process, "cf1", (0.0, 0.0, 0.0))


@pytest.fixture
def run(vehicle, tmp_path, capsys):
    """Return a function that runs a script with these lines: status, output, errors."""

    def run(word, *lines):
        path = tmp_path / "script.py"
        (tmp_path / "goals.py").write_text("GOAL = (0.5, 0.0, 1.2)\n")
        path.write_text(SCRIPT.format("\n    ".join(lines)))
        status = main([word, str(path), "cf1"])
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return run


def result(output):
    """Return the result of a dry run, which is one line of output."""
    (line,) = (each for each in output.splitlines() if each.startswith('{"dry_run": '))
    return json.loads(line)["dry_run"]


def test_a_dry_run_has_a_path_and_moves_no_vehicle(run, vehicle):
    status, output, _ = run("dry_run", "fleet.fly(mission)", "print('flown')")
    found = result(output)
    assert (status, found["passed"]) == (0, True)
    assert found["text"].startswith("cf1 fly for ")
    assert found["paths"]["cf1"][0] == [0.0, 0.0, 0.0]
    assert [0.5, 0.0, 1.2] in found["paths"]["cf1"]
    assert [text for _, text in found["steps"]][-1] == "land: cf1"
    # From one point to the next 0.2 s, in steps of 0.05 s.
    assert 0.2 <= found["duration"] / len(found["paths"]["cf1"]) <= 0.25
    assert "flown" not in output
    assert vehicle.position == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "line",
    ["mission(fleet)", "fleet.takeoff()", "fleet.adopt('cf1')", "fleet.vehicle('cf1')", "pass"],
)
def test_without_fly_there_is_no_dry_run(run, vehicle, line):
    status, output, _ = run("dry_run", line)
    text = "the script does not call fleet.fly(mission): there is no dry run of it"
    assert (status, result(output)["passed"], result(output)["text"]) == (1, False, text)
    assert vehicle.position == [0.0, 0.0, 0.0]


def test_why_a_dry_run_fails(run):
    status, output, _ = run("dry_run", "fleet.fly(lambda group: group.takeoff(-1.0))")
    assert status == 1
    assert result(output)["text"].startswith("takeoff: height is -1")


def test_a_flight_prints_its_commands_once(run):
    status, output, _ = run("fly", "fleet.fly(mission)")
    commands = [line.partition(" s  ")[2] for line in output.splitlines()]
    assert status == 0
    # The formation, too, is made of moves; the last command is that of the with block.
    assert commands == ["takeoff: cf1", "go_to: cf1", "formation: cf1", "land: cf1"]
    assert output.startswith("    0.0 s  takeoff")


def test_a_mission_goes_on_when_nothing_reads_its_output_any_more(run, monkeypatch, vehicle):
    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stdout", Closed())
    # Only the runner prints here.
    status, _, errors = run("fly", "fleet.fly(mission)")
    assert (status, errors) == (0, "")
    assert vehicle.position == pytest.approx([0.5, 0.0, 0.0], abs=0.05)


def test_why_a_flight_fails(run):
    status, _, errors = run("fly", "fleet.go_to((0, 0, 1))")
    assert status == 1
    assert errors.startswith("the mission failed: cf1: go_to: the vehicle is on the ground")
    assert run("fly", "raise KeyboardInterrupt")[::2] == (130, "interrupted\n")


def test_a_trajectory(vehicle, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    path = "~/eight.csv"
    trajectory_file.save(path, figure8())
    assert main(["dry_run", path, "cf1"]) == 0
    assert result(capsys.readouterr().out)["duration"] == pytest.approx(20.0, abs=5.0)
    assert main(["fly", path, "cf1"]) == 0
    assert "follow: cf1" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["flight", "one.py"], "invalid choice: 'flight'"),
        (
            ["fly", "none.py"],
            "the file /none.py does not exist; expected a script, or a trajectory",
        ),
        ([], "the following arguments are required: word, file"),
    ],
)
def test_bad_arguments(arguments, text, capsys, monkeypatch):
    monkeypatch.chdir("/")
    with pytest.raises(SystemExit):
        main(arguments)
    assert text in capsys.readouterr().err


def test_more_than_four_vehicles_are_counted(run, capsys):
    run("fly", "pass")
    group = DryRun({f"cf{k}": (float(k), 0.0, 0.0) for k in range(5)})
    group.observer = observer.of_process
    group.takeoff()
    assert capsys.readouterr().out == "    0.0 s  takeoff: 5 vehicles\n"


def test_an_observer_hears_when_a_command_of_a_subgroup_begins():
    heard = []

    class Recorder(MissionObserver):
        def begin(self, command, vehicles, time):
            heard.append((command, vehicles, time))

    group = DryRun({"cf1": (0.0, 0.0, 0.0), "cf2": (1.0, 0.0, 0.0)})
    group.observer = Recorder()
    with pytest.raises(MissionError):
        group["cf1"].go_to((0, 0, 1))
    group["cf2"].takeoff()
    # Its parts, such as the landing's, are not reported.
    group.land()
    assert [each[:2] for each in heard] == [
        ("go_to", ["cf1"]),
        ("takeoff", ["cf2"]),
        ("land", ["cf1", "cf2"]),
    ]
    assert heard[0][2] == heard[1][2] < heard[2][2] < group.time()
