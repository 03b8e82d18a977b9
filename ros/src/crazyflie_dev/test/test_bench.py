"""The bench goes on when a figure cannot be measured."""

import json

from crazyflie_dev.bench import __main__ as bench
from crazyflie_dev.bench.row import Row


def test_a_row_that_fails_is_one_of_the_results(monkeypatch, tmp_path, capsys):
    def fail():
        raise TimeoutError("no answer")

    rows = [Row("first", "the first", "s", fail), Row("second", "the second", "s", lambda: 2.0)]
    out = tmp_path / "folder" / "bench.json"
    monkeypatch.setattr(bench, "ROWS", rows)
    monkeypatch.setattr("sys.argv", ["bench", "--out", str(out)])
    assert bench.main() == 1
    printed = capsys.readouterr().out
    assert printed.startswith("2 figures, about 0 min")
    assert "TimeoutError: no answer" in printed
    first, second = json.loads(out.read_text())["rows"]
    assert (first["failed"], second["value"]) == ("TimeoutError: no answer", 2.0)
