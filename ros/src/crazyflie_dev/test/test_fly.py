"""The page and its vehicles: the command line, and what the terminal shows of a launch."""

import argparse
import os
import signal
import socket
import subprocess
import sys

import pytest

from crazyflie_dev.fly import STEPS, vehicles_and_arguments
from crazyflie_utils.testing.programs import LIMIT

#: Stands in for roslaunch: the page comes up, a vehicle warns, and Ctrl-C ends it.
ROSLAUNCH = """#!/bin/sh
trap 'echo "landed"; exit 0' INT
echo "PARAMETERS"
echo " * /cf1/time_step: 0.01"
[ -z "$FAILS" ] || { echo "RLException: no such file"; exit 1; }
echo "the dashboard is at http://127.0.0.1:8642/"
echo "[WARN] [1795984322.0]: /cf1: too far"
while :; do sleep 0.1; done
"""


@pytest.fixture
def fly(tmp_path):
    """Return a function that starts the program with words, and a launch that fails or not."""

    def fly(*words, fails=""):
        (tmp_path / "bin").mkdir()
        program = tmp_path / "bin" / "roslaunch"
        program.write_text(ROSLAUNCH)
        program.chmod(0o755)
        path = f"{program.parent}:{os.environ['PATH']}"
        return subprocess.Popen(
            [sys.executable, "-m", "crazyflie_dev.fly", "--out", str(tmp_path / "out"), *words],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "PATH": path, "FAILS": fails},
        )  # fmt: skip

    return fly


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.mark.parametrize(
    ("words", "n", "arguments"),
    [
        ([], 3, []),
        (["9"], 9, []),
        (["n:=9", "spacing:=2"], 9, ["spacing:=2"]),
        (["spacing:=2", "12"], 12, ["spacing:=2"]),
    ],
)
def test_n_is_a_number_with_or_without_its_name(words, n, arguments):
    names = [f"cf{k}" for k in range(1, n + 1)]
    assert vehicles_and_arguments(words, 3) == (names, arguments)


def test_files_and_folders_are_those_of_the_terminal(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab.yaml").write_text("robots:\n  left: {initial_position: [0, 0, 0]}\n")
    found = vehicles_and_arguments(["fleet:=lab.yaml", "folders:=.:/tmp"], 3)
    assert found == (["left"], [f"fleet:={tmp_path}/lab.yaml", f"folders:={tmp_path}:/tmp"])
    with pytest.raises(argparse.ArgumentTypeError, match="none is not a folder"):
        vehicles_and_arguments(["folders:=none"], 3)


@pytest.mark.parametrize("words", [["0"], ["n:=x"], ["3", "n:=4"], ["README.md"]])
def test_another_n_is_refused(words):
    with pytest.raises(argparse.ArgumentTypeError, match="expected one number of vehicles"):
        vehicles_and_arguments(words, 3)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_steps_address_and_warnings_are_shown_until_a_signal(fly, tmp_path, number):
    with fly(f"port:={free_port()}", "n:=2") as program:
        steps = [program.stdout.readline() for _ in STEPS.splitlines()]
        warning = program.stderr.readline()
        program.send_signal(number)
        _, errors = program.communicate(timeout=LIMIT)
    log = tmp_path / "out" / "fly.log"
    assert "".join(steps) == STEPS.format(n=2, url="http://127.0.0.1:8642/", log=log) + "\n"
    assert warning == "[WARN] /cf1: too far\n"
    assert errors == f"{number.name}: landing, then everything ends\n"
    assert "time_step: 0.01" in log.read_text()
    assert log.read_text().endswith("landed\n")
    assert program.returncode == 0


def test_a_launch_that_fails_ends_it_and_the_log_is_named(fly, tmp_path):
    with fly(f"port:={free_port()}", fails="yes") as program:
        printed, errors = program.communicate(timeout=LIMIT)
    assert (printed, program.returncode) == ("", 1)
    log = tmp_path / "out" / "fly.log"
    assert errors == f"RLException: no such file\nfly: the launch has ended; see {log}\n"


def test_words_are_checked_before_anything_is_launched(fly, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        for words, complaint in (
            ([f"port:={port}"], f"port {port} of 127.0.0.1 is in use by "),
            (["fleet:=none.yaml"], "none.yaml: cannot be read"),
            (["folder:=x"], "sw_swarm.launch has no argument folder; did you mean folders?"),
            (["3", "--out", str(tmp_path), "folder:=x"], "did you mean folders?"),
        ):
            with fly(*words) as program:
                _, errors = program.communicate(timeout=LIMIT)
            assert program.returncode == 2
            assert complaint in errors
            (tmp_path / "bin" / "roslaunch").unlink()
            (tmp_path / "bin").rmdir()
    assert not (tmp_path / "out").exists()
