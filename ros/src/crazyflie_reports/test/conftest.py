"""The program flight_report, for tests."""

import json

import pytest

from crazyflie_reports.bag_report import main


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a function that runs the program: status, what it prints, the tables of flights."""

    def run(*arguments):
        out = tmp_path / "out"
        monkeypatch.setattr("sys.argv", ["flight_report", *map(str, arguments), "--out", str(out)])
        status = main()
        data = out / "report.json"
        return (
            status,
            "".join(capsys.readouterr()),
            json.loads(data.read_text()) if data.exists() else [],
        )

    run.folder = tmp_path
    return run
