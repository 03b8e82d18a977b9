"""What a median makes of spikes: the exercise of lesson 2."""

from spike_filter.median import Median


def test_a_spike_leaves_no_trace():
    median = Median(window=3)
    assert [median.add(number) for number in (1.0, 1.0, 90.0, 1.2, 1.1)] == [1, 1, 1, 1.2, 1.2]


def test_a_window_of_one_changes_nothing():
    median = Median(window=1)
    assert [median.add(number) for number in (1.0, 90.0)] == [1.0, 90.0]
