"""Runs the doctor as a user does."""

import subprocess

_LIMIT = 90.0


def run_doctor(*arguments: str, may_warn: bool = False) -> tuple[int, list[str]]:
    """Return its exit status and the lines it has printed.

    With ``may_warn`` its node may warn, as all nodes do, of peers that it hears and that do wrong;
    otherwise nothing else is said.
    """
    done = subprocess.run(
        ["rosrun", "crazyflie_doctor", "doctor", "--timeout", "80", *arguments],
        capture_output=True,
        text=True,
        timeout=_LIMIT,
    )
    said = [line for line in done.stderr.splitlines() if line.strip()]
    assert all(may_warn and "[WARN]" in line for line in said), done.stderr
    return done.returncode, done.stdout.splitlines()


def about(check: str, lines: list[str]) -> str:
    """Return the lines about one thing."""
    return "\n".join(line for line in lines if line[7:].startswith(f"{check}: "))
