"""The examples fly in --sim: each script as it is, in this process."""

import os
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from crazyflie_py.simulation import Simulation

EXAMPLES = Path(__file__).parents[1] / "examples"
STARTS = np.array([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]])


@pytest.fixture
def fly(monkeypatch, caplog):
    """Return a function that flies a script and returns positions, shape (steps, vehicles, 3)."""
    track = []
    step = Simulation._step

    def recorded(self):
        step(self)
        track.append([vehicle.motion.position for vehicle in self.vehicles])

    def run(name, *options):
        script = str(EXAMPLES / name)
        monkeypatch.setattr(sys, "argv", [script, "--sim", "--vis", "null", *options])
        runpy.run_path(script, run_name="__main__")
        return np.array(track)

    monkeypatch.setattr(Simulation, "_step", recorded)
    with open(os.devnull) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        yield run
    unexpected = [r.getMessage() for r in caplog.records if "swarm.input" not in r.getMessage()]
    assert unexpected == []


def ends(track, height, places=STARTS):
    """Return whether all have landed above these places (shape (n, 3)) at a height (m)."""
    return np.allclose(track[-1], places + [0.0, 0.0, height], atol=1e-4)


def test_every_example_is_flown():
    tests = {name.removeprefix("test_") for name in globals() if name.startswith("test_")}
    assert {path.stem for path in EXAMPLES.glob("*.py")} <= tests


def test_hello_world(fly):
    track = fly("hello_world.py")
    assert track[:, 0, 2].max() == pytest.approx(1.0, abs=1e-4)
    assert track[-1] == pytest.approx(STARTS + [[0, 0, 0.04], [0, 0, 0]], abs=1e-4)


def test_nice_hover(fly):
    track = fly("nice_hover.py")
    assert track[50] == pytest.approx(STARTS + [0.0, 0.0, 1.0], abs=1e-4)
    assert ends(track, 0.02)


def test_swap(fly):
    assert ends(fly("swap.py"), 0.04, STARTS[::-1])


def test_figure8_csv(fly):
    track = fly("figure8_csv.py")
    around = track - STARTS
    assert np.ptp(around[:, :, 0]) == pytest.approx(1.5, abs=0.01)
    assert np.ptp(around[:, :, 1]) == pytest.approx(0.75, abs=0.01)
    # All fly the same.
    assert around[:, 0] == pytest.approx(around[:, 1], abs=1e-4)
    assert ends(track, 0.06)


def test_group_mask(fly):
    track = fly("group_mask.py")
    assert track[24] == pytest.approx(STARTS + [[0, 0, 1.0], [0, 0, 0.0]], abs=1e-4)
    assert track[49] == pytest.approx(STARTS + [[0, 0, 1.0], [0, 0, 0.5]], abs=1e-4)
    assert track[74] == pytest.approx(STARTS + [0.0, 0.0, 1.0], abs=1e-4)
    assert ends(track, 0.04)


def test_multi_trajectory(fly):
    track = fly("multi_trajectory.py")
    assert track[:, :, 0].max() == pytest.approx(0.8, abs=1e-3)
    assert track[:, :, 2].max() == pytest.approx(1.5, abs=0.01)
    assert ends(track, 0.04)


def test_full_state(fly):
    track = fly("full_state.py", "--dt", "0.02")
    assert np.ptp(track[:, 0, 0]) == pytest.approx(1.5, abs=0.01)
    assert track[:, 0, 2].max() == pytest.approx(0.8, abs=1e-3)
    assert track[-1, 0] == pytest.approx([0.0, -0.5, 0.04], abs=0.01)


def test_velocity_circle(fly):
    track = fly("velocity_circle.py", "--dt", "0.01")
    circle = track[300:850, 0, :2] - [-0.4, -0.5]
    assert np.linalg.norm(circle, axis=1) == pytest.approx(0.4, abs=0.02)
    assert track[-1, 0] == pytest.approx([0.0, -0.5, 0.04], abs=0.03)


def test_dance(fly):
    track = fly("dance.py")
    assert track[:, :, 0].max() == pytest.approx(0.3, abs=1e-4)
    assert track[:, :, 2].max() == pytest.approx(1.2, abs=1e-4)
    assert ends(track, 0.04)


def test_avoidance(fly):
    track = fly("avoidance.py")
    distances = np.linalg.norm(track[:, 0] - track[:, 1], axis=1)
    assert distances.min() >= 0.36
    assert ends(track, 0.04, STARTS[::-1])


def test_led_and_parameters(fly, capsys):
    track = fly("led_and_parameters.py")
    assert capsys.readouterr().out == "1 7 0.5\n2 7 0.5\n"
    assert ends(track, 0.04)


def test_button_landing(fly):
    track = fly("button_landing.py")
    assert track[:, :, 2].max() == pytest.approx(0.8, abs=1e-4)
    assert ends(track, 0.04)
