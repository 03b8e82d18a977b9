"""Nodes of the launch files, all of which can be initialized."""

import re
from pathlib import Path

import pytest
import rospkg

from crazyflie_ranging.ranger_nodes import DeckRangerNode, SimulatedRangerNode
from crazyflie_ranging.reaction_nodes import FollowObjectNode, ObstacleStopNode
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeProcess, launch_files, launching

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_ranging")) / "launch"

COMMON = {"obstacle_stop": ObstacleStopNode}
FOLLOW = {**COMMON, "follow_object": FollowObjectNode}

LIMIT = 60.0  #: How long a launch may take to end, s.


@pytest.mark.parametrize(
    ("file", "flight", "composed", "classes"),
    [
        ("follow_object", "sw", "true", {**FOLLOW, "simulated_ranger": SimulatedRangerNode}),
        ("follow_object", "virtual_hw", "false", {**FOLLOW, "deck_ranger": DeckRangerNode}),
        (
            "teleop_with_obstacle_stop",
            "sw",
            "false",
            {**COMMON, "simulated_ranger": SimulatedRangerNode},
        ),
    ],
)
def test_launch_files(file, flight, composed, classes):
    nodes, parameters = launch_files.expand(
        LAUNCH / f"{file}.launch", flight=f"{flight}_hover.launch", composed=composed, rviz="false"
    )
    process = FakeProcess(parameters)
    for name, node in classes.items():
        assert (f"/{name}" in nodes) == (composed == "false")
        if composed == "false":
            # Who reads files ends the launch, once, when they are wrong.
            reads_files = name in ("simulated_ranger", "deck_ranger")
            assert (nodes[f"/{name}"].required, nodes[f"/{name}"].respawn) == (
                reads_files,
                not reads_files,
            )
        assert process.launch(node(), f"/{name}"), process.logged("error")
    if composed == "true":
        assert classes.items() <= NODE_CLASSES(launch_files.composed_nodes(parameters)).items()
    steers = {"follow_object": "follow_object", "teleop_with_obstacle_stop": "joy_velocity"}[file]
    wanted = parameters["/obstacle_stop/topics/cmd_vel_in"]
    assert parameters[f"/{steers}/topics/cmd_vel"] == wanted
    obeyed = parameters["/velocity_reference/topics/cmd_vel"]
    assert obeyed == parameters["/obstacle_stop/topics/cmd_vel_out"] != wanted
    if flight == "virtual_hw":
        assert parameters["/virtual_crazyflie/multiranger"] is True
        assert parameters["/virtual_crazyflie/world"] == parameters["/world/world"]
        assert parameters["/crazyflie/crazyflie_add/genericLogTopics"] == ["ranges"]
        assert parameters["/deck_ranger/topics/log"] == "/crazyflie/ranges"


@pytest.mark.parametrize("wrong", ["world", "sensors"])
def test_a_wrong_file_ends_the_launch(tmp_path, monkeypatch, wrong):
    # Restored after the test.
    monkeypatch.setenv("ROS_MASTER_URI", "")
    monkeypatch.setenv("ROS_IP", "")
    file, log = tmp_path / "wrong.yaml", tmp_path / "log"
    file.write_text("shape: cube\n")
    with launching.roslaunch(
        ["crazyflie_ranging", "ranging.launch", f"{wrong}:={file}"], log
    ) as run:
        run.wait(LIMIT)
    told = re.findall(rf"(/\w+): {re.escape(str(file))}:1: ", log.read_text())
    # Once by each node that reads it, if the end of the other leaves it the time.
    assert told and len(told) == len(set(told))
    assert "REQUIRED process" in log.read_text()
