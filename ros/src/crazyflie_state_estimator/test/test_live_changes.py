"""Whatever live parameters change in flight, states are published and finite."""

import math

import pytest
from estimator_helpers import fly, launch, moving
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_state_estimator.estimator_node import KalmanParameters
from crazyflie_utils.testing.random_input import live_changes
from crazyflie_utils.vectors import to_tuple


@pytest.mark.filterwarnings("error")
@given(st.lists(live_changes(KalmanParameters), min_size=1, max_size=5), st.integers(0, 10))
def test_any_live_change_leaves_the_state_finite(changes, poses):
    process = launch(**{"filter/type": "kalman"})
    fly(process, moving, 0.01 * poses)
    for number, change in enumerate(changes):
        begin = 0.01 * poses + 0.2 * number
        process.reconfigure("/state_estimator", **change)
        before = len(process.published("/state"))
        fly(process, lambda elapsed, begin=begin: moving(begin + elapsed), 0.2)
        states = [to_tuple(message.state) for message in process.published("/state")[before:]]
        assert len(states) >= 15
        assert all(math.isfinite(number) for state in states for number in state)
    assert process.logged("error") == []
