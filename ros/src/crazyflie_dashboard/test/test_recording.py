"""Recordings: begun, ended, and made into a report."""

import os
import subprocess
import sys

import pytest

from crazyflie_dashboard.recording import Recorded, Recording
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.testing.programs import wait_until

LIMIT = 30.0

RECORDER = """
import pathlib, sys, time
folder = pathlib.Path(sys.argv[1].partition("=")[2]) / "2026-11-24"
folder.mkdir()
try:
    time.sleep(30)
except KeyboardInterrupt:
    (folder / "flight.bag").touch()
"""
REPORT = """
import pathlib, sys
is_compared = sys.argv[-1] == "--compare"
*folders, _, out = map(pathlib.Path, sys.argv[1 : -1 if is_compared else None])
assert is_compared == (len(folders) == 2)
assert all((each / "flight.bag").exists() for each in folders)
out.mkdir(parents=True)
names = ", ".join(each.name for each in folders)
(out / "report.html").write_text("the report on " + names)
"""


@pytest.fixture
def recording(tmp_path):
    def program(name):
        path = tmp_path / name
        text = RECORDER if name == "record_flight" else REPORT
        path.write_text(f"#!{sys.executable}\n{text}")
        path.chmod(0o755)
        return str(path)

    return Recording(tmp_path / "flights", program)


def test_a_recording_becomes_a_report(recording, tmp_path):
    recording.start()
    assert recording.text == "recording"
    with pytest.raises(RefusalError, match="record: recording; end it first"):
        recording.start()
    made = tmp_path / "flights" / "2026-11-24"
    subprocess.run(["sh", "-c", f"until [ -d {made} ]; do :; done"], timeout=LIMIT, check=True)
    report = recording.stop().result(LIMIT)
    assert report == str(made / "report" / "report.html") == str(recording.report)
    with pytest.raises(RefusalError, match="this dashboard has not started a recording"):
        recording.stop()


def test_what_fails_is_reported(recording, tmp_path):
    recording.start()
    recording._recorder.kill()
    texts = []
    end = recording.stop()
    end.add_done_callback(lambda _: texts.append(recording.text))
    with pytest.raises(RefusalError, match="nothing was recorded below"):
        end.result(LIMIT)
    wait_until(lambda: texts)
    # Who waits for the end may record again.
    assert texts == [""]


def test_a_recording_whose_report_cannot_be_made_is_ended_and_says_so(recording, tmp_path):
    def programs(name):
        if name == "flight_report":
            raise RefusalError("no flight_report; build the workspace")
        return record(name)

    record, recording._programs = recording._programs, programs
    recording.start()
    made = tmp_path / "flights" / "2026-11-24"
    wait_until(made.exists)
    with pytest.raises(RefusalError, match="recording: no flight_report; build the workspace"):
        recording.stop().result(LIMIT)
    assert recording.text == ""


def test_recordings_are_listed_and_two_become_one_report(recording, tmp_path):
    assert recording.known() == ()
    for name in ("2026-11-24", "2026-11-25"):
        folder = tmp_path / "flights" / name
        folder.mkdir(parents=True)
        text = "cf1:\n  buffer: 0.1\n  place_in_fleet: 0\nfleet:\n  n: 1\n"
        (folder / "parameters.yaml").write_text(text)
        (folder / "flight.bag").write_bytes(b"bag")
        os.utime(folder / "parameters.yaml", (1000.0, 1000.0))
        os.utime(folder / "flight.bag", (1012.0, 1012.0))
    newest, _ = recording.known()
    assert newest == Recorded("2026-11-25", 12.0, 3, ("cf1",), False)
    assert recording.report_on(["2026-11-25"]) is None
    assert recording.make_report(["2026-11-25"]).endswith("2026-11-25/report/report.html")
    assert recording.known()[0].has_report
    for names in ([], ["../flights"], ["2026-11-25", "2026-11-26"]):
        assert recording.report_on(names) is None
        with pytest.raises(RefusalError, match="expected one or two of: 2026-11-25, 2026-11-24"):
            recording.make_report(names)
    both = ["2026-11-24", "2026-11-25"]
    recording.make_report(both)
    assert recording.report_on(both).read_text() == "the report on 2026-11-24, 2026-11-25"
