"""Arrivals that are estimated, against those of streams whose reader is stopped at times."""

import random

import pytest

from mocap_optitrack.frame_times import ArrivalTimes

READING = 0.0001
"""How long it takes to read a frame that is there, s."""


def stream(period, seconds, jitter=0.0, silence=(0.0, 0.0), seed=1):
    """Return when frames arrive (s), but for a time in which the system sends none."""
    generator = random.Random(seed)
    begin, end = silence
    times = [period * number for number in range(1, round(seconds / period))]
    return [time + jitter * period * generator.random() for time in times if not begin < time < end]


def read(arrivals, *stalls):
    """Return when frames are read by a reader that stands still in some intervals (s)."""
    moments, free = [], 0.0
    for arrival in arrivals:
        moment = max(arrival, free)
        for begin, end in stalls:
            if begin <= moment < end:
                moment = end
        free = moment + READING
        moments.append(free)
    return moments


def estimated(moments):
    """Return the estimates for these moments."""
    times = ArrivalTimes()
    return [times.update(moment) for moment in moments]


@pytest.mark.parametrize("period", [0.003, 0.01, 0.04])
def test_a_frame_that_is_waited_for_arrives_when_it_is_read(period):
    moments = read(stream(period, 3.0, jitter=0.4))
    assert estimated(moments) == moments


@pytest.mark.parametrize("period", [0.003, 0.01])
def test_a_backlog_is_as_old_as_it_is(period):
    arrivals = stream(period, 4.0, jitter=0.2)
    moments = read(arrivals, (1.0, 1.6), (2.0, 2.1), (2.13, 2.5))
    results = estimated(moments)
    late = 0
    for arrival, moment, time in zip(arrivals, moments, results, strict=True):
        if time is None:
            continue
        assert arrival - 2.0 * period < time < arrival + 2.0 * period
        late += moment - time > 0.2
    assert late > 0.5 / period
    # After each stall, and for nothing else.
    assert sum(time is None for time in results) == 3
    assert results[-1] == moments[-1]


def test_a_stall_that_costs_frames_is_over_when_frames_are_waited_for():
    arrivals = [time for time in stream(0.01, 4.0) if not 1.1 < time < 1.9]
    moments = read(arrivals, (1.0, 2.0))
    late = [m - t for m, t in zip(moments, estimated(moments), strict=True) if t is not None]
    assert max(late) > 0.8
    assert late[-150:] == [0.0] * 150


def test_a_stream_that_pauses_comes_back_with_its_second_frame():
    moments = read(stream(0.01, 4.0, silence=(1.0, 3.0)))
    results = estimated(moments)
    (unknown,) = [k for k, time in enumerate(results) if time is None]
    assert moments[unknown] == pytest.approx(3.0, abs=0.02)
    assert results[unknown + 1 :] == moments[unknown + 1 :]


@pytest.mark.parametrize(("before", "after"), [(0.01, 0.004), (0.01, 0.03), (0.004, 0.03)])
def test_a_rate_that_is_changed_is_learned(before, after):
    arrivals = stream(before, 2.0) + [2.0 + time for time in stream(after, 6.0)]
    moments = read(arrivals)
    assert estimated(moments)[-10:] == moments[-10:]
