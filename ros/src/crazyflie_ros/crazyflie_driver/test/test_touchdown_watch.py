"""How long a landing takes, and when a vehicle stands."""

import pytest

from crazyflie_driver.monitors import (
    HOLD,
    LEAD,
    MAX_DEPTH,
    STEP,
    STEP_TIME,
    Next,
    Touchdown,
    landing_duration,
)

PERIOD = 0.1
DURATION = 3.0


@pytest.mark.parametrize(
    ("height", "most", "duration"),
    [(0.2, 7.0, 3.0), (2.5, 7.0, 5.0), (6.0, 7.0, 7.0), (6.0, 5.0, 5.0), (None, 7.0, 3.0)],
)
def test_a_landing_sinks_with_half_a_metre_per_second(height, most, duration):
    assert landing_duration(height, least=3.0, most=most) == duration


def fly(touchdown, height_at, target_at, end):
    """Log until something is needed, or a time (s); return it and when."""
    for k in range(round(end / PERIOD)):
        now = k * PERIOD
        height = height_at(now)
        speed = (height_at(now + 1e-3) - height) / 1e-3
        step = touchdown.sample(now, height, speed, target_at(now))
        if step is not Next.NOTHING:
            return step, now
    return Next.NOTHING, end


def test_a_vehicle_that_is_held_above_its_target_stands():
    """A table at 0.7 m, under a landing from 1 m with 0.5 m/s."""
    table = 0.7

    def target(now):
        return 1.0 - 0.5 * now

    step, now = fly(
        Touchdown(0.0, 0.0, 60.0), lambda now: max(target(now), table), target, DURATION
    )
    assert step is Next.STOP
    # At 0.6 s it meets the table.
    assert now == pytest.approx(0.6 + HOLD, abs=2.0 * PERIOD)


def test_a_vehicle_that_hovers_where_it_is_commanded_does_not_stand():
    """Another client has it hover in place of the landing, with an error of its height."""
    step, _ = fly(Touchdown(0.0, 0.0, 60.0), lambda _: 1.0, lambda _: 0.85, 30.0)
    assert step is Next.NOTHING


def test_a_vehicle_that_begins_to_sink_from_above_its_target_does_not_stand():
    """From 1.1 m, where 1.0 m was commanded, in 3 s, 0.3 s behind the firmware's curve."""

    def curve(now):
        s = min(max(now / DURATION, 0.0), 1.0)
        return 1.0 - (35.0 * s**4 - 84.0 * s**5 + 70.0 * s**6 - 20.0 * s**7)

    step, _ = fly(Touchdown(0.0, 0.0, 60.0), lambda now: 0.1 + curve(now - 0.3), curve, DURATION)
    assert step is Next.NOTHING


def test_a_vehicle_that_sinks_behind_its_target_does_not_stand():
    step, _ = fly(Touchdown(0.0, 0.0, 60.0), lambda now: 2.0 - 0.15 * now, lambda _: 0.0, 10.0)
    assert step is Next.NOTHING


def test_an_estimate_that_stands_still_with_a_speed_is_not_on_the_ground():
    """Motion capture is frozen; the accelerometer goes on."""
    touchdown = Touchdown(0.0, 0.0, 60.0)
    steps = {touchdown.sample(k * PERIOD, 1.0, -0.5, 0.0) for k in range(50)}
    assert steps == {Next.NOTHING}


def test_without_ground_it_descends_before_the_firmware_stops_the_motors():
    touchdown = Touchdown(0.0, 0.0, DURATION)
    end, height, descents = DURATION, 0.0, 0
    while True:
        step, now = fly(touchdown, lambda _: height, lambda _: height, 60.0)  # noqa: B023
        if step is Next.NOTHING:
            break
        assert step is Next.DESCENT
        assert end - LEAD <= now < end
        touchdown.descend(now)
        end, height, descents = now + STEP_TIME, height - STEP, descents + 1
    assert descents == MAX_DEPTH / STEP


@pytest.mark.parametrize("missing", range(3))
def test_without_an_estimate_nothing_is_done(missing):
    values = [0.75, 0.0, 0.0]
    values[missing] = None
    touchdown = Touchdown(0.0, 0.0, DURATION)
    assert {touchdown.sample(k * PERIOD, *values) for k in range(50)} == {Next.NOTHING}


def test_high_up_it_begins_no_descent_that_would_end_there():
    """Something has had it climb again; the whole landing is begun again."""
    step, _ = fly(Touchdown(0.0, 0.0, DURATION), lambda _: 1.0, lambda _: 1.0, 10.0)
    assert step is Next.NOTHING
