"""The command: what it answers, that it continues where it was interrupted, and on a cluster."""

import csv
import json
import socket
import threading

import matplotlib.image
import pytest
from distributed import LocalCluster

from crazyflie_batch import certify, figure, monte_carlo
from crazyflie_batch.monte_carlo_command import main
from crazyflie_batch.settings import read_settings
from crazyflie_utils.testing.programs import free_port

SAVE_FIGURE = figure.save_figure

SETTINGS = """\
flights: 40
duration: 3.0
settle_time: 2.0
K_file: K_soft.txt
limits: {error: 0.3}
sweep:
  mass_error: {uniform: [0.0, 0.1]}
  delay: {values: [0.0, 0.02]}
"""


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Return a function that runs the command in an empty folder: exit status, both outputs."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(monte_carlo, "CHUNK_SIZE", 16)
    monkeypatch.setattr(figure, "save_figure", lambda found, path: None)
    (tmp_path / "settings.yaml").write_text(SETTINGS)

    def run(*arguments):
        status = main(["settings.yaml", *arguments])
        return status, *capsys.readouterr()

    return run


def rows(folder):
    """Return flights.csv, a dictionary of numbers for each flight."""
    with open(folder / "flights.csv") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def test_it_answers_with_a_table_and_the_flights(command, tmp_path):
    status, output, _ = command()
    assert status == 0
    flights = rows(tmp_path / "settings")
    assert len(flights) == 40
    good = [row for row in flights if row["largest_error"] <= 0.3 and not row["has_crashed"]]
    assert 0 < len(good) < 40
    assert [row["is_within"] for row in good] == [1.0] * len(good)
    assert f"within limits   {len(good) / 40:.1%}" in output
    worst = max(flights, key=lambda row: row["largest_error"])
    assert f"worst flight    number {worst['flight']:.0f}\n" in output
    # A vehicle without integrator hangs the lower the heavier it is.
    line = next(line for line in output.splitlines() if line.startswith("mass_error "))
    assert float(line.split()[1]) > 0.5
    assert line.split()[2:][0] == "100%"
    assert line.split()[-1] == "0%"


def test_it_draws_a_figure(command, tmp_path, monkeypatch):
    monkeypatch.setattr(figure, "save_figure", SAVE_FIGURE)
    command()
    height, width, _ = matplotlib.image.imread(tmp_path / "settings" / "figure.png").shape
    assert width > height > 500


def test_a_flight_is_that_of_the_settings_whatever_flies_beside_it(command, tmp_path):
    command()
    settings = read_settings("settings.yaml")
    values = {name: part[[33]] for name, part in settings.values().items()}
    alone = monte_carlo.simulate(settings, 33, values)
    row = rows(tmp_path / "settings")[33]
    assert row["mass_error"] == pytest.approx(values["mass_error"][0])
    assert row["largest_error"] == pytest.approx(alone.largest_error[0], rel=1e-8)


def test_an_interrupted_run_continues(command, tmp_path, monkeypatch):
    _, whole, _ = command("--out", "whole")
    fly_chunk = monte_carlo.fly_chunk

    def interrupt(settings, first, values, code):
        if first == 16:
            raise KeyboardInterrupt
        return fly_chunk(settings, first, values, code)

    monkeypatch.setattr(monte_carlo, "fly_chunk", interrupt)
    status, _, errors = command("--out", "half")
    assert status == 130
    assert "the same command continues" in errors

    flown = []

    def note(settings, first, values, code):
        flown.append(first)
        return fly_chunk(settings, first, values, code)

    monkeypatch.setattr(monte_carlo, "fly_chunk", note)
    kept = [path.name for path in (tmp_path / "half" / "chunks").glob("0*.npy")]
    status, output, _ = command("--out", "half")
    assert status == 0
    assert set(flown) == {0, 16, 32} - {int(name[:-4]) for name in kept}
    assert output.replace("half", "whole") == whole


def test_flights_of_other_settings_are_not_mixed(command, tmp_path):
    command()
    (tmp_path / "settings.yaml").write_text(SETTINGS.replace("error: 0.3", "error: 0.2"))
    status, _, errors = command()
    assert status == 1
    assert "has flights of other settings; expected another --out, or --restart" in errors
    status, output, _ = command("--restart")
    assert status == 0
    assert "error at most 0.2 m" in output


def test_flights_of_two_versions_of_the_code_are_not_mixed(command, monkeypatch):
    command()
    monkeypatch.setattr(monte_carlo, "code_version", lambda: "another")
    status, _, errors = command()
    assert status == 1
    assert "settings has flights of another version of the code; expected another --out" in errors
    assert command("--restart")[0] == 0


@pytest.mark.parametrize("noted", [b"", b"[1]", b"\xff\0", b"{}"])
def test_a_folder_that_does_not_tell_what_it_has_is_refused(command, tmp_path, noted):
    command()
    (tmp_path / "settings" / "settings.json").write_bytes(noted)
    status, _, errors = command()
    assert status == 1
    assert "settings has flights of other settings; expected another --out" in errors


def test_a_folder_of_before_versions_were_noted_is_refused(command, tmp_path):
    command()
    path = tmp_path / "settings" / "settings.json"
    noted = json.loads(path.read_text())
    del noted["code"]
    path.write_text(json.dumps(noted))
    assert "another version of the code" in command()[2]


def test_a_worker_with_another_version_of_the_code_does_not_fly(command, monkeypatch):
    # The cluster's worker is a thread of this process.
    here = threading.current_thread()
    monkeypatch.setattr(
        monte_carlo, "code_version", lambda: str(threading.current_thread() is here)
    )
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        status, _, errors = command("--scheduler", cluster.scheduler_address)
    assert status == 1
    assert "a worker has another version of the code" in errors


def test_a_damaged_chunk_is_flown_again(command, tmp_path):
    _, whole, _ = command()
    chunk = next((tmp_path / "settings" / "chunks").glob("0*.npy"))
    chunk.write_bytes(chunk.read_bytes()[:20])
    status, _, errors = command()
    assert status == 1
    assert f"{chunk.name} was damaged, and is gone" in errors
    assert command()[:2] == (0, whole)


def test_a_folder_that_cannot_be_written_is_told(command, tmp_path):
    (tmp_path / "file").touch()
    status, _, errors = command("--out", "file/folder")
    assert status == 1
    assert "--out is file/folder: Not a directory; expected a folder" in errors


def test_what_is_wrong_ends_it_with_a_word(command, tmp_path):
    (tmp_path / "settings.yaml").write_text(SETTINGS.replace("40", "-40"))
    status, _, errors = command()
    assert status == 1
    assert "settings.yaml:1" in errors
    assert not (tmp_path / "settings").exists()


def test_a_cluster_flies_the_same(command):
    _, here, _ = command("--out", "here")
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        status, there, _ = command("--out", "there", "--scheduler", cluster.scheduler_address)
    assert status == 0
    assert there.replace("there", "here") == here


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:{}", "nonsense"])
def test_a_scheduler_that_is_not_there_is_told(command, monkeypatch, address):
    monkeypatch.setattr("crazyflie_batch.monte_carlo_command.SCHEDULER_LIMIT", 0.3)
    address = address.format(free_port(socket.SOCK_STREAM))
    status, _, errors = command("--scheduler", address)
    assert status == 1
    assert f"no scheduler at {address}" in errors
    assert "expected a dask scheduler" in errors


def test_a_scheduler_without_workers_is_told(command, monkeypatch):
    monkeypatch.setattr("crazyflie_batch.monte_carlo_command.SCHEDULER_LIMIT", 1.0)
    with LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:
        status, _, errors = command("--scheduler", cluster.scheduler_address)
    assert status == 1
    assert "has no workers; expected at least one" in errors


@pytest.mark.parametrize("command", [main, certify.main])
def test_without_a_file_the_shipped_settings_are_read(command, capsys):
    with pytest.raises(SystemExit):
        command(["--help"])
    assert "[SETTINGS.yaml]" in capsys.readouterr().out
