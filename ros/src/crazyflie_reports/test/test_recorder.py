"""The command line of recordings; what is recorded is seen in the demonstration."""

import re

import pytest
import rosparam

from crazyflie_reports import recorder

RECORDED = """/state /cf1/state /state/full_state /ref /cf1/ref_descent /ref/position_velocity_yaw
/control/final /cf1/control/lqr /in_flight /cf1/in_flight_flight_status /in_flight_filter_status
/tf /tf_static /rosout /diagnostics /crazyflie/cmd_vel /cf1/cmd_full_state /crazyflie/battery
/crazyflie/vehicle_status /mocap_node/cf7/pose /lqr_controller/parameter_updates
/a/b/goal""".split()
LEFT_OUT = (
    "/camera/image_raw /rosout_agg /clock /fleet/near_hover/states /crazyflie/packets".split()
)


def test_topics():
    assert all(re.fullmatch(recorder.TOPICS, topic) for topic in RECORDED)
    assert not any(re.fullmatch(recorder.TOPICS, topic) for topic in LEFT_OUT)


def test_topics_that_a_launch_file_has_renamed():
    tree = {
        "HY4": {
            "takeoff_server": {"topics": {"in_flight": "/in_flightHY4", "control": "up"}},
            "camera": {"topics": {"image": "/photo"}},
        },
        "lqr_controller": {"topics": {"state": "/estimate"}},
    }
    topics = recorder.topics_of(tree)
    for renamed in ("/in_flightHY4", "/in_flightHY4_flight_status", "/HY4/up", "/estimate"):
        assert re.fullmatch(topics, renamed)
    assert not any(re.fullmatch(topics, other) for other in (*LEFT_OUT, "/photo", "/up"))
    assert all(re.fullmatch(topics, topic) for topic in RECORDED)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a function that records with a program in the place of rosbag's."""

    def run(program, folder="flights"):
        path = tmp_path / "record"
        path.write_text(f"#!/bin/sh\n{program}\n")
        path.chmod(0o755)
        monkeypatch.setattr(recorder.roslib.packages, "find_node", lambda *names: [str(path)])
        monkeypatch.setattr(recorder, "master_answers", lambda: True)
        monkeypatch.setattr(rosparam, "dump_params", lambda path, name: open(path, "w").close())
        monkeypatch.setattr(rosparam, "get_param", lambda name: {})
        arguments = ["record_flight", f"--folder={tmp_path / folder}", "--topics=/x", "__name:=a"]
        monkeypatch.setattr("sys.argv", arguments)
        return recorder.main(), "".join(capsys.readouterr())

    return run


def test_says_how_large_the_recording_is(run, tmp_path):
    # The bag's name is the last but one argument, the node's name the last.
    write = 'for bag; do name=$before; before=$bag; done; head -c 2500000 /dev/zero > "$name"'
    status, output = run(write)
    assert status == 0
    (folder,) = (tmp_path / "flights").iterdir()
    assert f"recorded 2.5 MB in 1 bag: {folder}" in output
    assert {each.name for each in folder.iterdir()} == {"flight.bag", "parameters.yaml"}


def test_a_folder_that_cannot_be_made(run, tmp_path):
    (tmp_path / "file").write_text("")
    status, output = run("exit 0", "file/flights")
    assert status == 1
    assert "nothing is recorded into" in output


def test_without_a_master(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    monkeypatch.setattr("sys.argv", ["record_flight", f"--folder={tmp_path / 'flights'}"])
    assert recorder.main() == 1
    assert "no ROS master at http://127.0.0.1:1" in capsys.readouterr().err
    assert not (tmp_path / "flights").exists()


def test_the_status_is_that_of_rosbag(run):
    assert run("exit 3")[0] == 3
