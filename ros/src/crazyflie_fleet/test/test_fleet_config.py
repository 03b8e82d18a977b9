"""Pairs of places that are too close."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_fleet.fleet_config import DOWNWASH, close_pairs

COORDINATE = st.floats(-1.0, 1.0)


@given(
    st.lists(
        st.tuples(COORDINATE, COORDINATE, COORDINATE, st.floats(0.05, 0.5)), min_size=1, max_size=12
    )
)
def test_pairs_are_those_that_overlap(rows):
    table = np.array(rows)
    scaled = table[:, :3] / (1.0, 1.0, DOWNWASH)
    expected = {
        (i, j)
        for j in range(len(rows))
        for i in range(j)
        if math.dist(scaled[i], scaled[j]) < table[i, 3] + table[j, 3] - 1e-12
    }
    assert expected <= {pair[:2] for pair in close_pairs(table[:, :3], table[:, 3])}


def test_one_above_the_other_needs_more_distance():
    apart = ((0.0, 0.0, 0.0), (0.0, 0.5, 0.0))
    above = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.5))
    assert not list(close_pairs(np.array(apart), [0.2, 0.2]))
    assert [pair[:2] for pair in close_pairs(np.array(above), [0.2, 0.2])] == [(0, 1)]
