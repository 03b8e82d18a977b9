"""The launch file of the sweep and its configuration."""

from pathlib import Path

import pytest
import rospkg

from crazyflie_sweep.sweep_node import SweepNode
from crazyflie_sweep.sweep_parameters import Plan
from crazyflie_sweep.velocity_server_node import VelocityServerNode
from crazyflie_utils.main import NodeClasses
from crazyflie_utils.testing import FakeProcess, launch_files

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_sweep")) / "launch" / "sweep.launch"


@pytest.mark.parametrize("composed", ["false", "true"])
@pytest.mark.parametrize("flight", ["sw_hover.launch", "virtual_hw_hover.launch"])
def test_launch_file(composed, flight):
    nodes, parameters = launch_files.expand(LAUNCH, composed=composed, flight=flight, rviz="false")
    assert ("/sweep" in nodes) == (composed == "false")
    process = FakeProcess(parameters)
    assert process.launch(SweepNode(), "/sweep"), process.logged("error")
    if composed == "true":
        listed = NodeClasses()(launch_files.composed_nodes(parameters))
        assert listed["sweep"] is SweepNode
        assert listed["velocity_server"] is VelocityServerNode


def test_the_configuration_is_the_default():
    _, parameters = launch_files.expand(LAUNCH, rviz="false")
    node = SweepNode()
    assert FakeProcess(parameters).launch(node, "/sweep")
    for name in ("area", "lane_width", "height", "speed", "coverage"):
        assert getattr(node._parameters, name) == getattr(Plan.from_mapping({}), name)
