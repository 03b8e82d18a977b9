"""Controllers of other rates than 100 Hz: when a control is late depends on their usual period."""

import pytest
from filter_flight import FLYING, LIMITS, G, Supervised, level
from takeoff_helpers import SERVER, ControllerNode, HoverNetwork

from crazyflie_msgs.msg import FilterStatus
from crazyflie_takeoff.facts import LONGEST_HOLD, USUAL_HOLD, Timeouts


class SlowController(ControllerNode):
    """Sends one control of ten."""

    def __init__(self, count=10):
        super().__init__()
        self._count, self._skipped = count, 0

    def _on_state(self, message):
        self._skipped = (self._skipped + 1) % self._count
        if self._skipped == 0:
            super()._on_state(message)


def gentle(reference, z, z_dot):
    """Return the thrust of a controller that is stable at 10 Hz."""
    z_ref, z_dot_ref = reference
    return G + 1.0 * (z_ref - z) + 2.0 * (z_dot_ref - z_dot)


def test_a_controller_at_10_hz_is_not_held_and_its_end_is_noticed(monkeypatch):
    monkeypatch.setattr("takeoff_helpers.feedback", gentle)
    network = HoverNetwork(SERVER)
    network.start("controller", SlowController())
    network.take_off()
    begin = network.time
    network.advance(20.0)
    states = {message.state for _, message in network.on("/in_flight_filter_status", begin)}
    assert states <= {FilterStatus.PASSING}
    network.kill("controller")
    network.advance(0.45)
    assert network.on("/in_flight_filter_status")[-1][1].state == FilterStatus.HOLDING


@pytest.mark.parametrize(
    ("period", "hold"), [(0.005, USUAL_HOLD), (0.05, 0.15), (0.1, 0.3), (0.4, LONGEST_HOLD)]
)
def test_a_control_is_late_after_three_usual_periods(period, hold):
    supervised = Supervised(Timeouts(None, 0.5, 5.0, 3.0), LIMITS)
    supervised.flight_state = FLYING
    for k in range(100):
        supervised.commanded(period * k, "control", level(G))
    assert supervised.facts.hold == pytest.approx(hold, rel=0.01)


def test_a_time_that_is_given_stays():
    supervised = Supervised(Timeouts(0.2, 0.5, 5.0, 3.0), LIMITS)
    for k in range(100):
        supervised.commanded(0.4 * k, "control", level(G))
    assert supervised.facts.hold == 0.2
