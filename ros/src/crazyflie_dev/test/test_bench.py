"""The bench goes on when a figure cannot be measured, and compares with another workspace."""

import json
import os

import pytest

from crazyflie_dev import bench, bench_flights
from crazyflie_dev.bench import Row


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Run the bench with two flights, one of which fails; return exit status and rows."""
    rows = [Row("bad", "first", "the first", "s"), Row("good 3", "second", "the second", "s", 5.0)]

    def fail():
        raise TimeoutError("no answer")

    def measure(number):
        return {"second": float(number) * float(os.environ.get("FACTOR", 1.0))}

    def run(*arguments):
        out = tmp_path / "folder" / "bench.json"
        monkeypatch.setattr("sys.argv", ["bench", "--out", str(out), *map(str, arguments)])
        return bench.main(), json.loads(out.read_text())["rows"]

    monkeypatch.setattr(bench, "ROWS", rows)
    monkeypatch.setattr(bench_flights, "bad", fail, raising=False)
    monkeypatch.setattr(bench_flights, "good", measure, raising=False)
    yield run
    assert "FACTOR" not in os.environ


def test_a_row_that_fails_is_one_of_the_results(run, capsys):
    status, (first, second) = run()
    assert status == 1
    assert "TimeoutError: no answer" in capsys.readouterr().out
    assert (first["failed"], second["value"]) == ("TimeoutError: no answer", 3.0)
    assert (second["goal"], second["reached"]) == ("<= 5", True)


def test_a_reference_is_measured_in_its_own_environment(run, tmp_path, capsys):
    setup = tmp_path / "ros" / "devel" / "setup.bash"
    setup.parent.mkdir(parents=True)
    setup.write_text("export FACTOR=4\n")
    status, (row,) = run("--beside", tmp_path, "--rounds", 2, "second")
    assert (status, row["value"], row["reference"], row["ratio"]) == (0, 3.0, 12.0, 0.25)
    assert "0.25 x reference, 12" in capsys.readouterr().out


def test_every_row_has_a_flight():
    assert {row.flight.split()[0] for row in bench.ROWS} <= vars(bench_flights).keys()
