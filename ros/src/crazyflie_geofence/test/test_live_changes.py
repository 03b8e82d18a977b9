"""Whatever live parameters change in flight, the fence's control is finite and within limits."""

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_geofence_node import PARAMETERS, publish_regular, publish_state

from crazyflie_geofence.geofence_node import GeofenceNode, GeofenceParameters
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.testing.random_input import live_changes

STATE = st.tuples(*[st.floats(-5.0, 5.0)] * 6, st.floats(-3.0, 3.0))


@pytest.mark.filterwarnings("error")
@given(st.lists(st.tuples(live_changes(GeofenceParameters), STATE), min_size=1, max_size=4), STATE)
def test_any_live_change_leaves_the_control_sound(changes, at_rest):
    process = FakeProcess()
    assert process.launch(GeofenceNode(), "/geofence", PARAMETERS)
    publish_regular(process, 0.1, -0.1, 0.2, 10.0)
    for change, state in changes:
        for name, value in change.items():
            # A box without room for the proof is refused, and so are contrary bounds.
            with contextlib.suppress(ServiceError):
                process.reconfigure("/geofence", **{name: value})
        before = len(process.published("/control/geofence"))
        publish_state(process, *state)
        publish_state(process, *at_rest[:3], 0.0, 0.0, 0.0, 0.0)
        answers = process.published("/control/geofence")[before:]
        assert len(answers) == 2, process.logged("error")
        for message in answers:
            control = message.control.control
            assert max(abs(control.roll), abs(control.pitch)) <= MAX_TILT
            assert MIN_THRUST <= control.thrust <= MAX_THRUST
            assert control.yaw_dot == 0.2
            assert 0.0 <= message.control.priority <= 1.0
            assert math.isfinite(message.control.priority)
