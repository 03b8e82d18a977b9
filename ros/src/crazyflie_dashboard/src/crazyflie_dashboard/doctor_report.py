"""What the doctor says of this computer and the running graph."""

import subprocess

import roslib.packages

from crazyflie_dashboard.snapshot import Sentence

_TIMEOUT = 60.0  #: s; the doctor gives up after 40.


def examine() -> tuple[Sentence, ...]:
    """Run the doctor, with low priority; return what it has found, errors first. It takes 10 s."""
    found = roslib.packages.find_node("crazyflie_doctor", "doctor")
    if not found:
        return (
            Sentence("error", "doctor", "there is no doctor", "build the workspace (./run build)"),
        )
    try:
        done = subprocess.run(
            ["nice", "-n", "19", found[0]], capture_output=True, text=True, timeout=_TIMEOUT
        )
    except subprocess.TimeoutExpired:
        return (Sentence("error", "doctor", f"it did not end within {_TIMEOUT:g} s", "try again"),)
    return sentences(done.stdout)


def sentences(output: str) -> tuple[Sentence, ...]:
    """Return the findings in the doctor's output, errors first."""
    found = []
    for line in output.splitlines():
        level, _, rest = line.partition(" ")
        check, separator, text = rest.strip().partition(": ")
        if level in ("warn", "error") and separator:
            text, _, remedy = text.partition("; ")
            found.append(Sentence(level, f"doctor, {check}", text, remedy))
    return tuple(sorted(found, key=lambda each: each.level != "error"))
