"""Which vehicles are taken for ones that do not lift off."""

import pytest

from crazyflie_driver.monitors import LIFT_LIMIT, LiftWatch, NoLift

GROUND = 0.3
"""Where the vehicle stands in the frame of its estimate, m."""


class Attempt:
    """A stream of setpoints at 50 Hz, and samples of the vehicle at 10 Hz."""

    def __init__(self):
        self.watch = LiftWatch()
        self.now = 0.0
        self.findings = []
        self.run(0.2, told=None, is_flying=False)
        self.begin = self.now

    def run(self, duration, told=GROUND + 0.5, is_flying=True, estimate=lambda time: (GROUND, 0.0)):
        """Advance the time; ``estimate(time)`` returns height and speed since the beginning."""
        begin = self.now
        for k in range(round(50 * duration)):
            self.now = begin + 0.02 * k
            if told is not None:
                self.watch.command(self.now, told)
            if k % 5 == 0:
                height, speed = estimate(self.now - begin)
                finding = self.watch.sample(self.now, is_flying, height, speed)
                self.findings += [(self.now, finding)] if finding else []
        self.now = begin + duration


def test_a_vehicle_that_stands_is_found_once():
    attempt = Attempt()
    attempt.run(10.0)
    ((time, finding),) = attempt.findings
    assert finding == NoLift(GROUND + 0.5, is_certain=True)
    assert LIFT_LIMIT <= time - attempt.begin < LIFT_LIMIT + 0.2


def test_noise_of_the_estimate_is_no_flight():
    attempt = Attempt()
    attempt.run(3.0, estimate=lambda time: (GROUND + 0.02 * (-1) ** round(10 * time), 0.05))
    assert len(attempt.findings) == 1


def test_a_vehicle_that_lifts_off_in_time():
    attempt = Attempt()
    attempt.run(10.0, estimate=lambda time: (GROUND + max(0.0, 0.1 * (time - 1.0)), 0.1))
    assert attempt.findings == []


def test_a_vehicle_whose_estimate_rises_hardly_but_fast():
    """Motion capture is frozen, the vehicle climbs."""
    attempt = Attempt()
    attempt.run(10.0, estimate=lambda time: (GROUND + 0.03, 0.6 if time > 0.3 else 0.0))
    assert attempt.findings == []


@pytest.mark.parametrize("told", [None, GROUND, GROUND + 0.1, 0.0])
def test_setpoints_that_ask_for_no_climb(told):
    attempt = Attempt()
    attempt.run(10.0, told)
    assert attempt.findings == []


def test_a_vehicle_that_hovers_is_not_on_the_ground():
    attempt = Attempt()
    attempt.run(2.0, estimate=lambda time: (GROUND + 0.3 * time, 0.3))
    # It is told to climb, and is too weak.
    attempt.run(10.0, GROUND + 1.5, estimate=lambda time: (GROUND + 0.6, 0.0))
    # It lands, and its motors run on.
    attempt.run(10.0, GROUND + 1.5)
    assert attempt.findings == []


def test_after_a_landing_with_motors_off_it_is_on_the_ground_again():
    attempt = Attempt()
    attempt.run(2.0, estimate=lambda time: (GROUND + 0.3 * time, 0.3))
    attempt.run(0.5, None, is_flying=False, estimate=lambda time: (0.9, 0.0))
    attempt.run(3.0, 1.4, estimate=lambda time: (0.9, 0.0))
    assert len(attempt.findings) == 1


def test_a_stream_on_the_ground_with_motors_on_begins_no_attempt_before_it_asks_for_one():
    attempt = Attempt()
    attempt.run(5.0, GROUND)
    begin = attempt.now
    attempt.run(5.0)
    ((time, _),) = attempt.findings
    assert LIFT_LIMIT <= time - begin < LIFT_LIMIT + 0.2


def test_a_pause_begins_a_new_attempt():
    attempt = Attempt()
    attempt.run(1.5)
    attempt.run(1.2, None)
    attempt.run(1.5)
    assert attempt.findings == []
    attempt.run(1.0)
    assert len(attempt.findings) == 1


def test_a_stream_that_has_ended_is_no_attempt():
    attempt = Attempt()
    attempt.run(1.5)
    attempt.run(10.0, None)
    assert attempt.findings == []


@pytest.mark.parametrize("estimate", [(None, None), (GROUND, None), (None, 0.0)])
def test_without_an_estimate_only_motors_that_stand_still_are_found(estimate):
    attempt = Attempt()
    attempt.run(10.0, is_flying=True, estimate=lambda time: estimate)
    assert attempt.findings == []
    attempt = Attempt()
    attempt.run(10.0, is_flying=False, estimate=lambda time: estimate)
    ((_, finding),) = attempt.findings
    assert not finding.is_certain


def test_without_a_supervisor_nothing_is_found():
    attempt = Attempt()
    attempt.run(10.0, is_flying=None)
    assert attempt.findings == []
