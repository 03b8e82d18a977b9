"""The hardware example from end to end, on a virtual vehicle that is 5 % off."""

import pytest

from crazyflie_reports.flight_operator import ready_operator
from crazyflie_reports.flight_record import OVERSHOOT_LIMIT, TOUCHDOWN_LIMIT

HOVER = (0.0, 0.0, 1.0)
SETTLING = 10.0
TOLERANCE = 0.03


@pytest.fixture(scope="module")
def record():
    """Fly once; every test looks at the record."""
    with ready_operator() as operator:
        return operator.fly(SETTLING + 5.0)


def test_hovers_within_3_cm_after_10_s(record):
    mean, largest = record.hover_error(HOVER, 5.0)
    assert record.events["land"] - record.events["flying"] >= SETTLING + 5.0
    assert 0.0 < mean <= largest < TOLERANCE


def test_does_not_overshoot(record):
    assert record.overshoot(HOVER) < OVERSHOOT_LIMIT


def test_lands_softly(record):
    assert record.touchdown_speed() < TOUCHDOWN_LIMIT
    assert record.state.last[2] < 0.02
    assert record.final_control.last[3] == 0.0
