"""The message and the service: first their files, then the package that is built with them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from genmsg import MsgContext
from genmsg.msg_loader import load_msg_from_file, load_srv_from_file

PACKAGE = Path(__file__).resolve().parents[1]
FIELDS = [
    ("uint32", "number"),
    ("float64", "duration"),
    ("float64", "distance"),
    ("float64", "max_height"),
]
BUILD_LIMIT = 300.0
"""s; it takes about 10."""


def fields(spec):
    """Return type and name of the fields of a message."""
    return list(zip(spec.types, spec.names, strict=True))


def test_step_1_the_message_has_the_fields_of_a_flight():
    path = PACKAGE / "msg" / "Flight.msg"
    spec = load_msg_from_file(MsgContext.create_default(), str(path), "logbook/Flight")
    assert fields(spec) == FIELDS


def test_step_1_the_service_has_a_number_in_and_a_flight_out():
    path = PACKAGE / "srv" / "GetFlight.srv"
    spec = load_srv_from_file(MsgContext.create_default(), str(path), "logbook/GetFlight")
    assert fields(spec.request) == [("uint32", "number")]
    assert fields(spec.response) == [("logbook/Flight", "flight")]


def test_step_2_the_package_builds_and_its_types_can_be_imported(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "src" / "logbook")
    built = subprocess.run(
        ["catkin_make", "-C", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=BUILD_LIMIT,
        check=False,
    )
    assert built.returncode == 0, built.stdout[-2000:] + built.stderr[-2000:]
    [modules] = tmp_path.glob("devel/lib/python3*/*-packages")
    code = "from logbook.msg import Flight; from logbook.srv import GetFlight; print(Flight())"
    paths = os.pathsep.join([str(modules), os.environ.get("PYTHONPATH", "")])
    used = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert used.returncode == 0, used.stderr
    assert "max_height" in used.stdout
