"""Errors of a launch are reported."""

import contextlib

import pytest
import rosgraph

from crazyflie_utils.testing import launching, programs
from crazyflie_utils.testing.launching import LaunchError, complaints, roslaunch


def test_complaints_are_found_among_other_output(tmp_path):
    log = tmp_path / "launch.log"
    log.write_text(
        "started roslaunch server\n"
        "\x1b[31m[ERROR] [1.0]: /lqr_controller: parameter /lqr_controller/K_file is 'x'\x1b[0m\n"
        "[INFO] [2.0]: all is well\n"
        "\x1b[31m[lqr_controller-5] process has died [pid 1, exit code 1]\x1b[0m\n"
    )
    assert complaints(log) == [
        "[ERROR] [1.0]: /lqr_controller: parameter /lqr_controller/K_file is 'x'",
        "[lqr_controller-5] process has died [pid 1, exit code 1]",
    ]


TOP = """<launch>
  <arg name="speed" default="1" />
  <arg name="fixed" value="2" />
  <include file="$(dirname)/all.launch" pass_all_args="true" />
  <include file="$(dirname)/some.launch"><arg name="hidden" value="3" /></include>
</launch>"""


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ("sped:=2", "top.launch has no argument sped; did you mean speed?"),
        ("fixed:=2", "cannot override arg 'fixed'"),
        ("hidden:=2", "no argument hidden"),
    ],
)
def test_arguments_that_roslaunch_would_ignore_are_refused(tmp_path, given, complaint):
    (tmp_path / "top.launch").write_text(TOP)
    for name in ("all", "some"):
        arguments = '<arg name="height" default="1" />' * (name == "all")
        hidden = '<arg name="hidden" default="1" />' * (name == "some")
        (tmp_path / f"{name}.launch").write_text(f"<launch>{arguments}{hidden}</launch>")
    log = tmp_path / "log"
    with pytest.raises(LaunchError) as error, roslaunch([str(tmp_path / "top.launch"), given], log):
        pass
    assert complaint in str(error.value)
    with roslaunch([str(tmp_path / "top.launch"), "height:=3", "speed:=2", "__x:=1"], log):
        assert not complaints(log)


def test_a_launch_file_that_cannot_be_read_is_named(tmp_path):
    (tmp_path / "top.launch").write_text("<launch><arg /></launch>")
    for file in ("top.launch", "none.launch"):
        with pytest.raises(LaunchError, match=file), roslaunch([str(tmp_path / file)], tmp_path):
            pass


def test_the_end_of_a_launch_is_waited_for_in_words(tmp_path, monkeypatch):
    shown = []

    @contextlib.contextmanager
    def waiting(text):
        before = rosgraph.is_master_online()
        yield
        shown.append((text, before, rosgraph.is_master_online()))

    for module in (launching, programs):
        monkeypatch.setattr(module, "waiting", waiting)
    for name in ("ROS_MASTER_URI", "ROS_IP"):
        monkeypatch.setenv(name, "")  # Set by it, and put back after the test.
    with launching.master(tmp_path / "log"):
        pass
    # In one line: two of a terminal took turns ten times a second.
    assert shown[1:] == [("until rosmaster has ended", True, False)]
