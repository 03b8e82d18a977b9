"""The figure eight of the demo: from the hover point and back to it, at rest, and once around."""

import math

import numpy as np
import pytest

from crazyflie_dev.demo import EIGHT_DURATION, HOVER, eight, say_if_busy


def position(moment):
    """Return x, y, z at a time since the begin of the figure."""
    reference = eight(moment)
    return np.array([reference.x, reference.y, reference.z])


@pytest.mark.parametrize(("load", "is_busy"), [(1.9, False), (2.1, True)])
def test_a_busy_computer_is_said(load, is_busy, capsys):
    say_if_busy(load, processors=2)
    assert ("too busy: 2.1 programs" in capsys.readouterr().err) == is_busy


@pytest.mark.parametrize(("moment", "yaw"), [(0.0, 0.0), (EIGHT_DURATION, 2.0 * math.pi)])
def test_begins_and_ends_at_rest_at_the_hover_point(moment, yaw):
    reference = eight(moment)
    assert position(moment) == pytest.approx(HOVER, abs=1e-9)
    assert (reference.x_dot, reference.y_dot) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert reference.yaw == pytest.approx(yaw)


@pytest.mark.parametrize("moment", np.linspace(0.1, EIGHT_DURATION - 0.1, 20))
def test_velocities_are_those_of_the_positions(moment):
    step = 1e-5
    slope = (position(moment + step) - position(moment - step)) / (2.0 * step)
    reference = eight(moment)
    assert (reference.x_dot, reference.y_dot) == pytest.approx(slope[:2], abs=1e-6)
    assert math.hypot(*slope) < 2.0  # What the controller lets a reference have, m/s.
