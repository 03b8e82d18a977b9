"""Runs the doctor as a user does."""

import subprocess

_LIMIT = 90.0


def run_doctor(*arguments: str) -> tuple[int, list[str]]:
    """Return its exit status and the lines it has printed."""
    done = subprocess.run(
        ["rosrun", "crazyflie_tools", "doctor", "--timeout", "80", *arguments],
        capture_output=True,
        text=True,
        timeout=_LIMIT,
    )
    # What it connects to may make its node warn.
    errors = [line for line in done.stderr.splitlines() if line and "[WARN]" not in line]
    assert not errors, done.stderr
    return done.returncode, done.stdout.splitlines()


def about(check: str, lines: list[str]) -> str:
    """Return the lines about one thing."""
    return "\n".join(line for line in lines if line[7:].startswith(f"{check}: "))
