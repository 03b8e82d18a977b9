"""Flights with hardware gains in which the controller's output is not flown for a while."""

from pathlib import Path

import pytest
from rospkg import RosPack
from std_srvs.srv import EmptyRequest

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.testing.launch_files import composed_nodes, expand

PACKAGES = RosPack()
LAUNCH = Path(PACKAGES.get_path("crazyflie_examples")) / "launch/sw_hover.launch"
GAINS = {
    "K_file": str(Path(PACKAGES.get_path("crazyflie_lqr")) / "references/K_manual.txt"),
    **{"integrator_k_x": -0.05, "integrator_k_y": 0.05, "integrator_k_z": -0.5},
    **{"integrator_thresh_x": 1.0, "integrator_thresh_y": 1.0, "integrator_thresh_z": 6.0},
}
FILTER = "/takeoff_control_filter"
GAP = 2.8  # s; the filter lands a vehicle whose control stays away for 3 s.


def heights_after(begin, end, height):
    """Return the heights (m) after a gap with a step of the reference at its beginning."""
    _, parameters = expand(
        LAUNCH, composed=True, rviz=False, dynamics="quadrotor", estimator_filter="kalman", **GAINS
    )
    parameters["/simulator/mass_error"] = 0.05
    heights = []
    graph = FakeGraph(parameters)
    graph.listen("/tf", lambda m: heights.extend(t.transform.translation.z for t in m.transforms))
    for name, node in NODE_CLASSES(composed_nodes(parameters)).items():
        graph.start(f"/{name}", node())
    graph.advance(2.0)
    takeoff = graph.call("/takeoff", EmptyRequest())
    graph.advance(15.0)
    assert takeoff.exception(0) is None
    begin(graph)
    state = PositionVelocityState(z=height)
    graph.publish("/ref", PositionVelocityStateStamped(state=state))
    graph.advance(GAP)
    end(graph)
    before = len(heights)
    graph.advance(15.0)
    assert heights[-1] == pytest.approx(height, abs=0.05)
    return heights[before:]


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
