"""Missions: programs that are listed, rehearsed, flown and stopped."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from crazyflie_dashboard.missions import Missions, listed
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.testing.programs import wait_until

LIMIT = 30.0

STAND_IN = """#!{python}
import json, os, sys, time
_, _, runner, word, path, *vehicles = sys.argv
assert runner == "crazyflie_mission_api.mission_runner"
if word == "dry_run":
    passed = "bad" not in path
    result = dict(passed=passed, text="far" if passed else "cf1: y is 3 m", duration=4.0)
    result["steps"] = [[0.0, "takeoff: cf1"], [1.5, "land: cf1"]]
    result["paths"] = dict(cf1=[[0, 0, 0], [0, 0, 1]])
    print("from crazyflie_mission_api: loading")
    line = json.dumps(dict(dry_run=result))
    print(line[:-30] if "killed" in path else line)
    sys.exit(0 if passed else 1)
if "waits" in path:
    print("    1.5 s  takeoff: cf1", flush=True)
    try:
        time.sleep({limit})
    except KeyboardInterrupt:
        print("lands", flush=True)
        while not os.path.exists(path + ".ground"):
            time.sleep(0.01)
        print("has landed")
        open(path + ".landed", "w").close()
        sys.exit(130)
print("cf1 is lost")
sys.exit(1 if "fails" in path else 0)
"""


@pytest.fixture
def missions(tmp_path):
    """Missions whose interpreter is a program that answers as the runner and scripts do."""
    program = tmp_path / "python"
    program.write_text(STAND_IN.format(python=sys.executable, limit=LIMIT))
    program.chmod(0o755)
    return Missions(str(program), tmp_path / "flights")


@pytest.fixture
def script(tmp_path):
    def write(name, text="import crazyflie_mission_api\n"):
        path = tmp_path / "missions" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    return write


def test_scripts_of_missions_and_trajectories_are_listed(script, tmp_path):
    mission, trajectory = script("one.py"), script("two.csv", "1,2\n")
    script("other.py", "print('hello')\n")
    script("notes.txt")
    assert listed([tmp_path / "missions", tmp_path / "missing"]) == (mission, trajectory)


def test_a_script_that_cannot_be_read_is_not_listed(script):
    mission = script("one.py")
    # A regular file, without any data at its beginning.
    mission.with_name("unreadable.py").symlink_to("/proc/self/mem")
    for name in ("beyond.py", "beyond.csv", "beyond"):
        mission.with_name(name).symlink_to("x" * 300)
    assert listed([mission.parent]) == (mission,)


def test_a_dry_run_that_cannot_be_started_says_so(script, tmp_path):
    missions = Missions(str(tmp_path / "no python"), tmp_path / "flights")
    with pytest.raises(FileNotFoundError):
        missions.dry_run(script("one.py"), ("cf1",), {}).result(LIMIT)


def test_a_dry_run_whose_result_breaks_off_has_not_passed(missions, script):
    result = missions.dry_run(script("killed.py"), ("cf1",), {}).result(LIMIT)
    assert (result.passed, result.paths) == (False, {})
    assert result.text.startswith('its result is damaged: {"dry_run": ')


def test_a_mission_that_is_open_in_an_editor_can_be_rehearsed(missions, script):
    mission = script("one.py")
    mission.with_name(".#one.py").symlink_to("somebody@somewhere.4711")
    assert missions.dry_run(mission, ("cf1",), {}).result(LIMIT).passed


def test_a_dry_run_has_a_result_and_paths(missions, script):
    result = missions.dry_run(script("one.py"), ("cf1",), {}).result(LIMIT)
    assert (result.passed, result.text) == (True, "far")
    assert result.paths == {"cf1": ((0, 0, 0), (0, 0, 1))}


def test_what_has_not_passed_does_not_fly(missions, script):
    bad = script("bad.py")
    with pytest.raises(RefusalError, match=r"bad.py: expected a dry run of it that has passed"):
        missions.fly(bad, ("cf1",), {})
    result = missions.dry_run(bad, ("cf1",), {}).result(LIMIT)
    assert (result.passed, result.text) == (False, "cf1: y is 3 m")
    with pytest.raises(RefusalError, match="expected a dry run"):
        missions.fly(bad, ("cf1",), {})


def test_another_script_or_other_vehicles_need_another_dry_run(missions, script):
    mission = script("one.py")
    missions.dry_run(mission, ("cf1",), {}).result(LIMIT)
    with pytest.raises(RefusalError, match="expected a dry run"):
        missions.fly(mission, ("cf2",), {})
    os.utime(mission, (1.0, 1.0))
    with pytest.raises(RefusalError, match="expected a dry run"):
        missions.fly(mission, ("cf1",), {})


def test_one_mission_flies_at_a_time_until_it_is_stopped(missions, script):
    mission = script("waits.py")
    missions.dry_run(mission, ("cf1",), {}).result(LIMIT)
    end = missions.fly(mission, ("cf1",), {})
    assert missions.running[0].startswith("waits.py")
    assert [each[:2] for each in missions.steps] == [("takeoff: cf1", 1.5), ("land: cf1", 2.5)]
    wait_until(lambda: missions.running[0].endswith("takeoff: cf1"))
    assert [each.state for each in missions.steps] == ["now", "next"]
    with pytest.raises(RefusalError, match=r"waits.py is still flying; wait for its end"):
        missions.fly(mission, ("cf1",), {})
    missions.stop()
    Path(f"{mission}.ground").touch()
    assert end.result(LIMIT) == ""
    assert missions.running == missions.steps == ()
    with pytest.raises(RefusalError, match="no mission that a dashboard has started is flying"):
        missions.stop()


def test_a_second_stop_does_not_interrupt_the_landing(missions, script):
    mission = script("waits.py")
    missions.dry_run(mission, ("cf1",), {}).result(LIMIT)
    end = missions.fly(mission, ("cf1",), {})
    wait_until(lambda: missions.running[0].endswith("takeoff: cf1"))
    missions.stop()
    with pytest.raises(
        RefusalError,
        match=r"waits.py was stopped before, and its vehicles are "
        "landing",
    ):
        missions.stop()
    Path(f"{mission}.ground").touch()
    assert end.result(LIMIT) == ""
    assert Path(f"{mission}.landed").exists()


DASHBOARD = """
import sys
from pathlib import Path
from crazyflie_dashboard.missions import Missions
python, folder, path = sys.argv[1:]
missions, mission = Missions(python, Path(folder)), Path(path)
assert missions.dry_run(mission, ("cf1",), {}).result().passed
missions.fly(mission, ("cf1",), {})
print("flies", flush=True)
sys.stdin.read()
"""


def test_a_mission_outlives_its_dashboard_and_the_next_one_stops_it(script, missions, tmp_path):
    mission = script("waits.py")
    arguments = [str(tmp_path / "python"), str(tmp_path / "flights"), str(mission)]
    command = [sys.executable, "-c", DASHBOARD, *arguments]
    with subprocess.Popen(command, stdin=-1, stdout=-1) as first:
        assert first.stdout.readline() == b"flies\n"
        first.kill()
    second = Missions(*map(Path, arguments[:2]))
    wait_until(lambda: second.running[0].endswith("takeoff: cf1"), limit=LIMIT)
    with pytest.raises(RefusalError, match=r"waits.py is still flying"):
        second.fly(mission, ("cf1",), {})
    second.stop()
    third = Missions(*map(Path, arguments[:2]))
    with pytest.raises(RefusalError, match="was stopped before"):
        third.stop()
    Path(f"{mission}.ground").touch()
    # Output after its dashboard's end must not end the mission before it has landed.
    wait_until(lambda: Path(f"{mission}.landed").exists(), limit=LIMIT)
    wait_until(lambda: second.running == () == third.running, limit=LIMIT)


def test_a_process_that_has_the_number_of_a_mission_now_is_not_stopped(missions, tmp_path):
    (tmp_path / "flights").mkdir()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=-1) as other:
        record = {"title": "one.py", "pid": other.pid, "began": 1, "is_stopped": False}
        record["master"] = os.environ.get("ROS_MASTER_URI", "")
        (tmp_path / "flights" / f"{other.pid}.json").write_text(json.dumps(record))
        found = Missions("python", tmp_path / "flights")
        assert found.running == ()
        with pytest.raises(RefusalError, match="no mission that a dashboard has started is flying"):
            found.stop()
        assert other.poll() is None
        other.communicate(b"\n")


def test_a_dry_run_expires_when_a_vehicle_or_what_a_script_imports_changes(missions, script):
    mission, other = script("fails.py"), script("helper.py", "SPEED = 1.0\n")
    here, there = {"cf1": (0.0, 0.0, 0.0)}, {"cf1": (0.0, 0.5, 0.0)}
    missions.dry_run(mission, ("cf1",), here).result(LIMIT)
    with pytest.raises(RefusalError, match="cf1 is not where it was at the dry run"):
        missions.fly(mission, ("cf1",), there)
    os.utime(other, (1.0, 1.0))
    with pytest.raises(RefusalError, match="expected a dry run of it that has passed"):
        missions.fly(mission, ("cf1",), here)


def test_a_mission_that_is_stopped_while_python_starts_has_not_failed(tmp_path, script):
    program = tmp_path / "python"
    program.write_text(
        '#!/bin/sh\ncase "$*" in *dry_run*) echo \'{"dry_run": {"passed": true, "text": "",'
        ' "duration": 1.0, "paths": {}}}\';; *) echo "Fatal Python error: init_import_site: ..."'
        "; exit 1;; esac\n"
    )
    program.chmod(0o755)
    missions, mission = Missions(str(program), tmp_path / "flights"), script("one.py")
    missions.dry_run(mission, ("cf1",), {}).result(LIMIT)
    assert missions.fly(mission, ("cf1",), {}).result(LIMIT) == ""


def test_why_a_mission_has_failed_is_what_it_said_last(missions, script):
    mission = script("fails.py")
    missions.dry_run(mission, ("cf1",), {}).result(LIMIT)
    with pytest.raises(RefusalError, match="cf1 is lost"):
        missions.fly(mission, ("cf1",), {}).result(LIMIT)


SWARM = """
from pycrazyswarm import Crazyswarm
swarm = Crazyswarm(args="")
print([each.prefix for each in swarm.allcfs.crazyflies])
swarm.allcfs.takeoff(0.5, 1.0)
swarm.timeHelper.sleep(1.5)
swarm.allcfs.land(0.0, 1.0)
swarm.timeHelper.sleep(1.5)
assert len(swarm.allcfs.crazyflies) == 1
"""


def test_a_dry_run_is_one_whatever_options_a_script_of_crazyswarm_gives_itself(script, monkeypatch):
    # Where it would look for vehicles that fly there is no master.
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    result = Missions().dry_run(script("swarm.py", SWARM), ("cf2",), {}).result(LIMIT)
    assert (result.passed, result.text) == (True, "flown by ideal vehicles")


def test_a_script_of_crazyswarm_is_told_which_vehicles_are_chosen(missions, script, tmp_path):
    (tmp_path / "python").write_text(
        f"#!{sys.executable}\nimport os, sys\n"
        "is_dry = os.environ.get('CRAZYFLIE_PY_DRY_RUN')\n"
        "if is_dry: sys.exit(0)\n"
        "sys.exit('for ' + os.environ['CRAZYFLIE_PY_VEHICLES'])\n"
    )
    mission = script("swarm.py", SWARM)
    missions.dry_run(mission, ("cf1", "cf3"), {}).result(LIMIT)
    with pytest.raises(RefusalError, match="for cf1:cf3"):
        missions.fly(mission, ("cf1", "cf3"), {}).result(LIMIT)
