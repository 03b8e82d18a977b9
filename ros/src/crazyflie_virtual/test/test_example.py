"""The manual's cflib program flies a virtual vehicle as it is."""

import subprocess
import sys
from pathlib import Path

import pytest

from crazyflie_utils.testing.programs import wait_until

TOP = Path(__file__).resolve().parents[4]
PROGRAM = TOP / "docs" / "examples" / "cflib_hover" / "hover.py"

LIMIT = 60.0  #: The program flies for 9 s.


@pytest.fixture
def run():
    """Return ``run(uri)``, which starts the program; it is ended at the end."""
    processes = []

    def run(uri):
        process = subprocess.Popen(
            [sys.executable, PROGRAM, uri],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return process

    yield run
    for process in processes:
        process.kill()
        process.communicate()


def test_a_plain_cflib_program_flies(serve, run):
    server, uri = serve()
    process = run(uri)
    wait_until(lambda: server.observe().position[2] > 0.45, "the takeoff")
    wait_until(lambda: server.observe().position[0] > 0.45, "the way to the right")
    assert server.observe().position[2] == pytest.approx(0.5, abs=0.1)
    out, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, err
    rows = [tuple(map(float, line.split())) for line in out.splitlines()]
    assert max(z for _, _, z in rows) == pytest.approx(0.5, abs=0.1)
    x, y, z = server.observe().position
    assert (x, y, z) == pytest.approx((0.5, 0.0, 0.0), abs=0.1)
    wait_until(lambda: not any(server.vehicle.board.firmware.stabilizer.commands), "the end")
