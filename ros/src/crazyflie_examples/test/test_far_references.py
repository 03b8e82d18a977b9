"""Flights on references that are further away than a step may be, and are sent once."""

import math

import pytest
from hover_graph import HoverGraph


@pytest.mark.parametrize("dynamics", ["near_hover", "quadrotor"])
def test_a_waypoint_far_away_that_is_sent_once_is_reached(dynamics):
    flight = HoverGraph(dynamics=dynamics)
    flight.take_off(8.0)
    flight.refer(3.8, 0.0, 1.0, "/waypoints")
    flight.graph.advance(14.0)
    # The takeoff server has sent the hover point shortly before, so it rests after 3 m.
    assert math.dist(flight.course[-1], (3.8, 0.0, 1.0)) < 0.05
    assert max(x for x, _, _ in flight.course) < 3.9
    flight.refer(-3.0, 4.0, 2.0, "/waypoints")
    flight.graph.advance(14.0)
    assert math.dist(flight.course[-1], (-3.0, 4.0, 2.0)) < 0.05
    texts = [text for level, text in flight.graph.log if level == "warn" and "m away" in text]
    assert len(texts) == 2
    assert texts[1].endswith("/ref: the reference is 8.0 m away; flying there at 1 m/s")


def test_a_hover_point_far_above_is_reached():
    flight = HoverGraph(takeoff_hover_z=4.5)
    flight.take_off(16.0)
    assert flight.course[-1][2] == pytest.approx(4.5, abs=0.05)
    assert max(z for _, _, z in flight.course) < 4.6


def test_a_second_node_does_not_pull_a_vehicle_away_step_by_step():
    flight = HoverGraph()
    flight.take_off(14.0)
    for _ in range(40):
        flight.refer(50.0, 0.0, 1.0, "/broken")
        flight.graph.advance(0.5)
        flight.refer(0.5, 0.0, 1.0, "/mission")
        flight.graph.advance(0.5)
    assert max(x for x, _, _ in flight.course) < 3.6
