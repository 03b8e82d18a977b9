"""Flights with hardware gains in which the controller's output is not flown for a while."""

import pytest
from hover_graph import HARDWARE, HoverGraph

FILTER = "/takeoff_control_filter"
GAP = 2.8  # s; the filter lands a vehicle whose control stays away for 3 s.


def heights_after(begin, end, height):
    """Return the heights (m) after a gap with a step of the reference at its beginning."""
    flight = HoverGraph(0.05, **HARDWARE)
    flight.take_off()
    begin(flight.graph)
    flight.refer(0.0, 0.0, height)
    flight.graph.advance(GAP)
    end(flight.graph)
    before = len(flight.course)
    flight.graph.advance(15.0)
    heights = [z for _, _, z in flight.course[before:]]
    assert heights[-1] == pytest.approx(height, abs=0.05)
    return heights


@pytest.mark.parametrize("height", [0.6, 1.8])
def test_a_gap_in_which_the_filter_holds_winds_no_integrator_up(height):
    held = heights_after(
        lambda graph: graph.unheard.add((FILTER, "/control/lqr")),
        lambda graph: graph.unheard.clear(),
        height,
    )
    # A step of 0.8 m without a gap overshoots by 0.45 m.
    assert min(held) > min(height, 1.0) - 0.45
    assert max(held) < max(height, 1.0) + 0.55


def test_a_filter_that_is_frozen_winds_no_integrator_up():
    """Nothing reaches the vehicle, which comes down; it climbs again without a leap."""
    climb = heights_after(
        lambda graph: graph.freeze(FILTER), lambda graph: graph.thaw(FILTER), height=1.0
    )
    assert max(climb) < 1.4
