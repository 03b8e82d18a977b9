"""Flights that try to leave the fence, and the command that prints how many did."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from crazyflie_batch import certify
from crazyflie_batch.fence_flights import fly

WITHIN, SEARCHED, BEYOND = range(3)


@pytest.fixture
def settings(tmp_path):
    """Return settings of a small run, from a file."""
    return certify.read_settings(
        _write(tmp_path, "model: cf21\nflights: 2000\nvary: 2.0\nseed: 3\n")
    )


def _write(folder, text):
    path = folder / "settings.yaml"
    path.write_text(text)
    return str(path)


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(certify, "CHUNK_SIZE", 500)
    monkeypatch.setattr(certify, "GENERATIONS", 5)


def test_no_flight_within_the_bounds_leaves(settings, small):
    with ThreadPoolExecutor(1) as executor:
        rows = certify.run(replace(settings, duration=1.5), executor)
    assert rows[WITHIN].flights == 2000
    assert rows[WITHIN].left == rows[SEARCHED].left == 0
    # They came near: the fence is tested, not the room.
    assert -0.002 < rows[WITHIN].farthest < 0.0
    # The same flights can leave.
    assert rows[BEYOND].left > 0.05 * rows[BEYOND].flights
    text = certify.table(settings, rows)
    assert "below 0.0015" in text
    assert f"{rows[BEYOND].left / rows[BEYOND].flights:.2%}" in text


def test_without_the_fence_they_leave(settings):
    chunk = certify.drawn(settings, 0, 200, 1.0)
    # The fence knows of a wall that is 1 km away.
    blind = replace(chunk.case, high=chunk.case.high + 1e3)

    def press(t, p, v, a, walls):
        return np.full_like(p, 2.0)

    assert np.all(fly(blind, chunk.policy, 0, press) + 1e3 > 0.0)
    assert np.all(fly(chunk.case, chunk.policy, 0, press) < 0.0)


def test_a_controller_of_ones_own_is_flown(tmp_path, small, capsys):
    # Of more than A, the adversary may take a part.
    (tmp_path / "mine.py").write_text("def control(t, p, v, a, walls):\n    return 1.4 + 0.0 * p\n")
    text = "model: cf21\nflights: 500\nduration: 3.0\ncontroller: mine.py:control\n"
    settings = certify.read_settings(_write(tmp_path, text))
    farthest = certify.outside(certify.drawn(settings, 0, 50, 1.0))
    # The controller has the say, not 50 adversaries.
    assert np.ptp(farthest) < 0.2
    assert np.all(farthest < 0.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("model: cf22\n", "model (settings.yaml:1) is 'cf22'"),
        ("model: cf21\nbraking: {vertical: 1.0}\n", "expected more than the disturbance, 1 m"),
        ("model: cf21\ncontroller: other.py:control\n", "no such file; expected FILE.py:FUNCTION"),
        ("model: cf21\ncontroller: mine.py:other\n", "KeyError('other'); expected FILE.py"),
        ("model: cf21\ncontroller: mine.py:scalar\n", "it returned [0. 0. 0.]; expected FILE.py"),
        ("model: empty.yaml\n", "has no identified/bounds/lag/horizontal"),
    ],
)
def test_bad_settings_are_named(tmp_path, text, expected, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("def scalar(t, p, v, a, walls):\n    return [0, 0, 0]\n")
    (tmp_path / "empty.yaml").write_text("type: cf21\n")
    assert certify.main([_write(tmp_path, text).replace(f"{tmp_path}/", "")]) == 1
    assert expected in capsys.readouterr().err
