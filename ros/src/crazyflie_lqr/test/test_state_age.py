"""How old a state is, by a stamp that may be of another clock."""

import pytest

from crazyflie_lqr.state_age import StateAge

NOW = 1.7e9


def ages(*arrivals, age=None):
    """Return the ages of states, given as (stamp, now)."""
    age = age or StateAge()
    return [age.update(stamp, now, now) for stamp, now in arrivals]


@pytest.mark.parametrize("delay", [-5.0, -0.1, 0.0, 0.01, 0.6, 30.0, 59.0])
def test_a_stamp_of_the_same_clock_is_an_age(delay):
    assert ages((NOW - delay, NOW)) == pytest.approx([delay])


def test_a_backlog_is_old_however_long_it_is():
    fresh = [(NOW + 0.01 * k, NOW + 0.01 * k) for k in range(10)]
    # The controller stood still for 100 s and gets all that was sent meanwhile.
    late = [(NOW + 0.1 + 0.01 * k, NOW + 100.0 + 1e-5 * k) for k in range(9990)]
    found = ages(*fresh, *late)
    assert max(found[:10]) == 0.0
    assert found[10] == pytest.approx(99.9)
    assert min(found[10:-50]) > 0.5


def test_one_that_is_sent_again_after_a_minute_is_old():
    assert ages((NOW, NOW), (NOW, NOW + 90.0))[1] == 90.0


@pytest.mark.parametrize("offset", [NOW - 12.0, 3600.0, -1e6])
def test_of_another_clock_only_the_delay_to_the_quickest_counts(offset):
    found = ages(*[(NOW - offset + 0.01 * k, NOW + 0.01 * k) for k in range(1000)])
    assert max(map(abs, found)) < 0.1
    late = [*[(NOW - offset + 0.01 * k, NOW + 0.01 * k) for k in range(100)]]
    late += [(NOW - offset + 1.0 + 0.01 * k, NOW + 4.0) for k in range(300)]
    assert ages(*late)[100] == pytest.approx(3.0, abs=0.1)
    assert ages(*late)[-1] == pytest.approx(0.0, abs=0.1)


def test_another_clock_may_be_slower():
    found = ages(*[(5.0 + 0.01 * k, NOW + 0.01 * k * 1.0001) for k in range(100_000)])
    assert max(found) < 0.1


@pytest.mark.parametrize("stamp", [0.0, 12.000000345])
def test_a_stamp_that_stays_says_nothing(stamp):
    assert ages(*[(stamp, NOW + k) for k in range(10)]) == [0.0] * 10


def test_one_without_a_stamp_is_taken_as_new_in_simulated_time_too():
    assert ages((0.0, 5.0), (0.0, 30.0)) == [0.0, 0.0]


def test_another_clock_that_restarts_does_so():
    assert ages((50.0, NOW), (51.0, NOW + 1.0), (1.0, NOW + 2.0), (2.0, NOW + 3.0)) == (
        pytest.approx([0.0] * 4, abs=0.01)
    )


def test_the_same_clock_is_recognised_after_something_of_another():
    age = StateAge()
    assert ages((NOW - 500.0, NOW), (NOW, NOW), age=age) == [0.0, 0.0]
    assert age.update(NOW - 400.0, NOW, NOW) == 400.0


def test_a_reset_of_simulated_time_restarts_everything():
    age = StateAge()
    ages((500.0, 500.0), age=age)
    assert age.update(0.1, 0.1, 0.1) == 0.0
    assert age.update(0.2, 0.9, 0.9) == pytest.approx(0.7)


@pytest.mark.parametrize(
    "step", [sign * step for step in (0.05, 1.0, 30.0, 3600.0, 86400.0) for sign in (-1, 1)]
)
@pytest.mark.parametrize("offset", [0.0, 500.0, -500.0, 1e9])
def test_states_are_answered_after_the_wall_clock_was_set(step, offset):
    """Also where the source's clock, which is not set, is another one: ``offset`` s behind."""
    age = StateAge()
    for k in range(100):
        now = NOW + 0.01 * k
        assert abs(age.update(now - offset - 0.005, now, 0.01 * k)) < 0.01
    stamp = NOW + 1.0 - offset - 0.005
    # One state is under way; it may be refused.
    age.update(stamp, NOW + 1.0 + step, 1.0)
    source = 0.0 if offset else step
    for k in range(101, 300):
        now = NOW + 0.01 * k + step
        stamp = NOW + 0.01 * k + source - offset - 0.005
        assert age.update(stamp, now, 0.01 * k) < 0.5
