"""Eight vehicles fly figures of eight, all at the same time."""

import math
from pathlib import Path

import numpy as np
import pytest
import rospkg
from flown import nearest, recorded, run

EXAMPLE = Path(rospkg.RosPack().get_path("crazyflie_mission_api")) / "examples/figure_eights.py"
NAMES = [f"cf{k}" for k in range(1, 9)]


@pytest.fixture(scope="module")
def tracks():
    """Fly once; return where the vehicles were."""
    with recorded(NAMES) as found:
        assert run(EXAMPLE) == (0, "")
        return found


@pytest.mark.parametrize("number", range(8))
def test_every_vehicle_flies_an_eight_and_lands(tracks, number):
    track = np.array(tracks[NAMES[number]])
    x, y, _ = track[0]
    side = 1.0 if number % 2 == 0 else -1.0
    for turn in (-1.0, 1.0):
        top = (x + turn * 0.75 * math.sqrt(0.5), y + turn * side * 0.375, 1.0)
        assert nearest(track, top) < 0.15
    assert np.ptp(track, axis=0) == pytest.approx([1.5, 0.75, 1.0], abs=0.2)
    assert track[-1] == pytest.approx([x, y, 0.0], abs=0.1)
