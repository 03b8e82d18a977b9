"""The tools as processes, without a ROS master, on a virtual vehicle."""

import os
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from crazyflie_utils.testing.programs import running
from crazyflie_virtual.settings import FIRST_PORT
from crazyflie_virtual.testing import virtual_vehicle

LIMIT = 60.0

SCANNED_HOST = "127.77.0.5"
"""An address of this machine whose ports nothing else uses."""

UNUSED = "127.77.0.6"


def command(tool, *arguments):
    return ["rosrun", "crazyflie_tools", tool, *arguments]


def environment(**variables):
    # Nothing listens on port 1: there is no ROS master.
    return {**os.environ, "ROS_MASTER_URI": "http://127.0.0.1:1", **variables}


def run(tool, *arguments, **variables):
    """Return exit status, output and errors of a tool."""
    done = subprocess.run(
        command(tool, *arguments),
        env=environment(**variables),
        capture_output=True,
        text=True,
        timeout=LIMIT,
        stdin=subprocess.DEVNULL,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="module")
def virtual():
    with virtual_vehicle(host=SCANNED_HOST, port=FIRST_PORT) as virtual:
        yield virtual


@pytest.fixture
def uri(virtual):
    return virtual[1]


def test_scan_finds_the_vehicle(uri):
    assert run("scan", SCAN_ADDRESS=SCANNED_HOST)[:2] == (0, uri + "\n")


def test_scan_finds_no_vehicle():
    status, out, err = run("scan", SCAN_ADDRESS=UNUSED)
    assert (status, out) == (1, "")
    assert err.startswith("scan: no vehicle found by radio (address E7E7E7E7E7)")


def test_lists(uri):
    status, out, err = run("listParams", "--uri", uri)
    assert (status, err) == (0, "")
    assert {"ring.effect (uint8) 6", "stabilizer.estimator (uint8) 2"} <= set(out.splitlines())
    assert len(out.splitlines()) > 100
    status, out, err = run("listLogVariables", "--uri", uri)
    assert (status, err) == (0, "")
    assert {"stateEstimate.x (float)", "stateEstimateZ.quat (uint32)"} <= set(out.splitlines())


def test_a_parameter_is_read_set_and_read(uri):
    assert run("setParam", "--uri", uri, "posCtlPid.xKp", "1.7") == (0, "1.7\n", "")
    assert run("getParam", "--uri", uri, "posCtlPid.xKp") == (0, "1.7\n", "")


def test_the_example_of_the_readme(virtual):
    readme = (Path(__file__).parents[1] / "README.md").read_text()
    example = readme.partition("```console\n")[2].partition("```")[0]
    example = example.replace("127.0.0.1", SCANNED_HOST)
    commands = [step.partition("\n")[::2] for step in example.split("$ ")[1:]]
    assert len(commands) == 6
    for line, printed in commands:
        done = subprocess.run(
            ["bash", "-c", line],
            env=environment(SCAN_ADDRESS=SCANNED_HOST),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=LIMIT,
        )
        assert done.stdout == printed, line


def test_reboot_needs_a_radio(uri):
    status, out, err = run("reboot", "--uri", uri)
    assert (status, out) == (1, "")
    assert err.startswith(f"reboot: {uri}: only a radio link")


def test_wrong_usage(uri):
    status, out, err = run("getParam", "--uri", uri)
    assert (status, out) == (2, "")
    assert "usage: getParam" in err
    assert run("setParam", "--help")[0] == 0


def test_a_closed_port_is_reported():
    status, out, err = run("listParams", "--uri", f"udp://{UNUSED}:{FIRST_PORT}")
    assert (status, out) == (1, "")
    assert "nothing listens on this port" in err


@pytest.fixture
def silent_uri():
    """Return the address of a port that never answers."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        yield "udp://{}:{}".format(*silent.getsockname())


def test_a_silent_port_is_reported(silent_uri):
    status, out, err = run("listParams", "--uri", silent_uri)
    assert (status, out) == (1, "")
    assert "no answer has come within 2 s" in err


def test_the_time_limit_ends_the_process(silent_uri):
    status, out, err = run("listParams", "--uri", silent_uri, "--timeout", "0.2")
    assert (status, out, err) == (1, "", "listParams: not done within 0.2 s\n")


@pytest.fixture
def console():
    """Return a virtual vehicle that has just been started, and the process that listens to it."""
    pipe = subprocess.PIPE
    with (
        virtual_vehicle() as (server, uri),
        running(
            *command("console", "--uri", uri),
            env=environment(),
            stdout=pipe,
            stderr=pipe,
            text=True,
        ) as process,
    ):
        yield server, process
        process.stdout.close()
        process.stderr.close()


def test_console_is_printed_until_it_is_interrupted(console):
    _, process = console
    lines = iter(process.stdout.readline, "")
    assert any("up and running" in line for line in lines)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(LIMIT) == 0
    assert process.stderr.read() == ""


def test_console_ends_when_the_vehicle_falls_silent(console):
    server, process = console
    assert process.stdout.readline()
    server.switches.silence = LIMIT
    assert process.wait(LIMIT) == 1
    assert "has not been heard" in process.stderr.read()


def test_it_is_no_error_when_the_output_is_not_read(uri):
    # `true` is at its end long before the tool prints.
    pipe = 'set -o pipefail; "$@" | true'
    done = subprocess.run(
        ["bash", "-c", pipe, "-", *command("listParams", "--uri", uri)],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_doctor_still_runs_from_here():
    status, out, err = run("doctor", "--help")
    assert (status, err) == (0, "")
    assert out.startswith("usage: doctor")
