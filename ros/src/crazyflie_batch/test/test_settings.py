"""Settings files: what is wrong is told with file and line, before anything flies."""

from pathlib import Path

import numpy as np
import pytest

from crazyflie_batch.settings import read_settings
from crazyflie_utils import ParameterError

CONFIG = Path(__file__).parent.parent / "config" / "monte_carlo.yaml"

GOOD = """\
flights: 10
duration: 1.0
settle_time: 0.5
K_file: K_soft.txt
vehicle:
  attitude_noise: 0.002
sweep:
  mass_error: {uniform: [-0.2, 0.2]}
"""


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a settings file and returns its path."""

    def write_text(text):
        path = tmp_path / "settings.yaml"
        path.write_text(text)
        return path

    return write_text


def test_files_are_found_from_home(write, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "mine.txt").write_text(4 * f"{7 * '2 '}\n")
    write(GOOD.replace("K_soft.txt", "~/mine.txt").replace("0.002", "2e-3"))
    settings = read_settings("~/settings.yaml")
    assert settings.K[0][0] == 2.0
    assert settings.vehicle.attitude_noise == 0.002


def complaint(path):
    """Return what is said about a file."""
    with pytest.raises(ParameterError) as error:
        read_settings(path)
    return str(error.value).replace(str(path), "FILE")


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("flights: 10", "flights: -10", 1, ["flights", "-10", "an integer from 1"]),
        ("flights: 10", "flights: 10\nflight: 3", 2, ["flight ", "expected one of"]),
        ("duration: 1.0", "duration: 0.0", 2, ["duration", "> 0"]),
        (
            "settle_time: 0.5",
            "settle_time: 2.0",
            1,
            ["settle_time is 2", "expected 0 to 0.99"],
        ),
        ("settle_time: 0.5", "settle_time: 0.995", 1, ["settle_time is 0.995", "0 to 0.99,"]),
        ("settle_time: 0.5", "settle_time: 1", 1, ["settle_time is 1", "0 to 0.99,"]),
        ("duration: 1.0\nsettle_time: 0.5", "duration: 0.004\nsettle_time: 0", 1, ["one period"]),
        ("settle_time: 0.5", "period: 0.0011", 1, ["period", "0.002 s"]),
        ("K_soft.txt", "K_none.txt", 4, ["K_none.txt", "expected 4 rows of 7 numbers"]),
        ("K_soft.txt", "K" * 1000, 4, ["KKK", "File name too long, expected 4 rows"]),
        ("K_soft.txt", '"a\\0b"', 4, ["null byte, expected 4 rows of 7 numbers"]),
        ("[-0.2, 0.2]", "[-0.2, " + "x" * 1000 + "]", 8, ["xxx", "a finite number"]),
        ("uniform:", "? " + "x" * 1000 + "\n   :", 8, ["xxx", "uniform", "normal", "values"]),
        ("attitude_noise", "attitude_nose", 6, ["attitude_nose", "attitude_noise"]),
        ("0.002", "-0.002", 6, ["attitude_noise", ">= 0"]),
        ("mass_error", "mas_error", 8, ["mas_error is not a parameter", "mass_error"]),
        ("uniform:", "triangular:", 8, ["triangular", "uniform", "normal", "values"]),
        ("[-0.2, 0.2]", "[0.2, -0.2]", 8, ["lower number first"]),
        ("[-0.2, 0.2]", "[-0.2, 0.1, 0.2]", 8, ["3 entries", "lowest, highest"]),
        ("[-0.2, 0.2]", "[-0.2, 0.7]", 8, ["0.7", "<= 0.5"]),
        ("[-0.2, 0.2]", "[-0.2, heavy]", 8, ["heavy", "a finite number"]),
        ("[-0.2, 0.2]", "0.2", 8, ["0.2", "a list"]),
        ("  mass_error: {uniform: [-0.2, 0.2]}", "  {}", 8, ["sweep", "at least one"]),
        ("attitude_noise", "mass_error", 8, ["sweep/mass_error is also in line 6 under vehicle"]),
        ("sweep:", "model: near_hover\nsweep:", 9, ["no difference", "near_hover"]),
        ("sweep:\n  mass_error: {uniform: [-0.2, 0.2]}\n", "", 1, ["sweep"]),
    ],
)
def test_what_is_wrong_is_told_with_its_line(write, old, new, line, words):
    assert old in GOOD
    text = complaint(write(GOOD.replace(old, new)))
    assert f"FILE:{line}" in text
    assert all(word in text for word in words), text
    assert len(text) < 800


def test_a_file_that_is_not_there_is_told(tmp_path):
    assert "cannot be read" in complaint(tmp_path / "none.yaml")


def test_gain_files_beside_the_settings_come_first(write, tmp_path):
    (tmp_path / "K_soft.txt").write_text("1 2 3 4 5 6 7\n" * 4)
    assert read_settings(write(GOOD)).K == ((1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),) * 4


def test_the_file_that_is_shipped_is_good():
    settings = read_settings(CONFIG)
    assert settings.vehicle.attitude_noise == 0.002
    assert {sweep.kind for sweep in settings.sweeps} == {"uniform", "normal", "values"}


def test_parameters_are_drawn_as_the_file_says(write):
    text = GOOD.replace("flights: 10", "flights: 5000") + (
        "  delay: {values: [0.02, 0.0]}\n  thrust_error: {normal: [0.1, 0.02]}\n"
        "  dropout: {normal: [0.0, 0.1]}\n"
    )
    values = read_settings(write(text)).values()
    assert -0.2 <= values["mass_error"].min() < -0.19
    assert 0.19 < values["mass_error"].max() <= 0.2
    assert np.unique(values["delay"]).tolist() == [0.0, 0.02]
    assert values["delay"].mean() == pytest.approx(0.01, abs=0.001)
    assert values["thrust_error"].mean() == pytest.approx(0.1, abs=0.002)
    assert values["thrust_error"].std() == pytest.approx(0.02, abs=0.002)
    # A probability is not negative, whatever is drawn.
    assert values["dropout"].min() == 0.0
