"""The command, without a ROS master."""

import os
import subprocess

LIMIT = 60.0


def run_doctor(*arguments, **variables):
    """Return exit status, output and errors."""
    done = subprocess.run(
        ["rosrun", "crazyflie_doctor", "doctor", *arguments],
        # Nothing listens on port 1: there is no ROS master.
        env={**os.environ, "ROS_MASTER_URI": "http://127.0.0.1:1", **variables},
        capture_output=True,
        text=True,
        timeout=LIMIT,
        stdin=subprocess.DEVNULL,
    )
    return done.returncode, done.stdout, done.stderr


def test_doctor_without_a_master():
    status, out, err = run_doctor()
    assert err == ""
    assert "no ROS master at http://127.0.0.1:1, the graph was not checked" in out
    # Version of this computer's Python, on which the tests pass.
    assert status == 0, out


def test_doctor_with_a_wrong_network():
    status, out, _ = run_doctor(ROS_IP="192.0.2.77")
    assert status == 1
    assert "ROS_IP '192.0.2.77' is 192.0.2.77, no address of this computer" in out


def test_wrong_usage():
    status, out, err = run_doctor("--duration", "-1")
    assert (status, out) == (2, "")
    assert "--duration" in err
