"""Scripts on the vehicles of a simulated fleet, on a fake process, and on ideal ones."""

from pathlib import Path

import numpy as np
import pytest
import rospkg
from uav_trajectory import Polynomial4D, Trajectory

from crazyflie_fleet import fleet_process
from crazyflie_mission_api import fleet
from crazyflie_mission_api.dry_run import IdealVehicle
from crazyflie_mission_api.mission_vehicle import MissionVehicle
from crazyflie_mission_api.ros_vehicle import RosVehicle
from crazyflie_py import Crazyswarm
from crazyflie_py.crazyflie import Crazyflie, CrazyflieServer
from crazyflie_py.crazyswarm_py import build_argparser
from crazyflie_py.ros_swarm import RosSwarm
from crazyflie_py.simulated_vehicle import SimulatedVehicle
from crazyflie_utils.testing import FakeProcess

GAINS = Path(rospkg.RosPack().get_path("crazyflie_lqr")) / "config"
NODES = {
    "simulator": {"time_step": 0.02},
    "state_estimator": {"time_step": 0.02},
    "lqr_controller": {
        "K_file": str(GAINS / "K_sim.txt"),
        "u_ref_file": str(GAINS / "u_ref_hover.txt"),
    },
}
FILE = """
robots:
  cf10: {initial_position: [0, 0, 0]}
  cf2: {initial_position: [0, 1, 0]}
"""


@pytest.fixture
def attach(monkeypatch, tmp_path):
    """Return a function that begins a script which names no vehicles, in a process with a fleet."""
    process = FakeProcess()

    class FakeClock:
        def __init__(self, handle, has_ended):
            self.time = process.clock.time

        def wait_until(self, condition, deadline):
            while not (is_met := condition()) and self.time() < deadline:
                process.advance(0.05)
            return is_met

    monkeypatch.setattr(fleet, "RosClock", FakeClock)
    monkeypatch.setattr(fleet, "mission_nodes", lambda handle: 0)
    monkeypatch.setattr(process, "start", lambda: process.advance(0.1))
    file = tmp_path / "fleet.yaml"
    file.write_text(FILE)
    tree = {"simulated": True, "nodes": NODES, "fleet": {"file": str(file)}}
    process.transport.set_param("/fleet", tree)
    for name, node in fleet_process.make_nodes(process.handle("/fleet")).items():
        assert process.launch(node, name), process.logged("error")
    process.advance(0.6)
    options = build_argparser().parse_args([])
    return lambda: CrazyflieServer(RosSwarm(None, options, process))


@pytest.fixture
def allcfs(attach):
    """Return all vehicles of a script that names none."""
    return attach()


def test_vehicles_are_in_the_order_of_the_fleet_file(allcfs):
    assert [cf.name for cf in allcfs.crazyflies] == ["cf10", "cf2"]
    assert [cf.id for cf in allcfs.crazyflies] == [10, 2]


def test_a_script_has_only_the_vehicles_that_are_chosen_outside_of_it(attach, monkeypatch):
    monkeypatch.setenv("CRAZYFLIE_PY_VEHICLES", "cf3:cf4")
    with pytest.raises(SystemExit, match="CRAZYFLIE_PY_VEHICLES is cf3:cf4; expected vehicles of"):
        attach()
    monkeypatch.setenv("CRAZYFLIE_PY_VEHICLES", "cf2:cf3")
    assert [cf.name for cf in attach().crazyflies] == ["cf2"]


def test_a_parameter_of_the_real_firmware_is_kept_and_said_once(allcfs, caplog):
    allcfs.setParam("usd.logging", 1)
    allcfs.setParam("usd.logging", 0)
    assert [cf.getParam("usd/logging") for cf in allcfs.crazyflies] == [0, 0]
    (record,) = caplog.records
    assert "setParam: the simulation has no parameter usd.logging" in record.message


@pytest.mark.parametrize("vehicle", [IdealVehicle, RosVehicle, SimulatedVehicle])
def test_vehicles_of_missions_have_all_commands_of_scripts(vehicle):
    commands = {
        "takeoff": "takeoff",
        "land": "land",
        "stop": "stop",
        "goTo": "go_to",
        "startTrajectory": "start_trajectory",
        "notifySetpointsStop": "notify_setpoints_stop",
        "emergency": "emergency",
        "arm": "arm",
        "uploadTrajectory": "upload_trajectory",
        "setGroupMask": "set_group_mask",
        "cmdFullState": "send",
    }
    for script_name, name in commands.items():
        assert hasattr(Crazyflie, script_name)
        # A method that only the protocol declares would do nothing.
        assert getattr(vehicle, name) is not getattr(MissionVehicle, name), name


def flight(allcfs, sleep):
    """Fly a script; return the positions after each of its parts, (parts, 2, 3), m."""
    one, two = allcfs.crazyflies
    trajectory = Trajectory()
    trajectory.polynomials = [Polynomial4D(2.0, [0.0, 0.0, 0.3, -0.1], [0], [0], [0])]
    trajectory.duration = 2.0
    track = []

    def wait(duration):
        sleep(duration)
        track.append([cf.position() for cf in (one, two)])

    one.setGroupMask(1)
    two.setGroupMask(2)
    allcfs.takeoff(0.8, 2.0)
    wait(5.0)
    allcfs.goTo([0.4, 0.0, 0.2], 0.0, 2.0)
    wait(3.0)
    one.uploadTrajectory(0, 0, trajectory)
    one.startTrajectory(0)
    wait(3.0)
    allcfs.goTo([0.0, 0.5, 0.0], 0.0, 2.0, groupMask=2)
    wait(3.0)
    for _ in range(10):
        one.cmdPosition([0.9, 0.0, 1.1])
        sleep(0.1)
    one.notifySetpointsStop()
    wait(1.0)
    allcfs.land(0.0, 2.0)
    wait(6.0)
    return np.array(track)


def test_a_script_flies_alike_on_ideal_and_on_running_vehicles(attach):
    swarm = Crazyswarm(FILE, args="--sim --vis null")
    ideal = flight(swarm.allcfs, swarm.timeHelper.sleep)
    running = attach()
    measured = flight(running, running._swarm.sleep)
    assert ideal[1] == pytest.approx(np.array([[0.4, 0.0, 1.0], [0.4, 1.0, 1.0]]), abs=1e-3)
    assert ideal[3, 1] == pytest.approx([0.4, 1.5, 1.0], abs=1e-3)
    assert measured[:-1] == pytest.approx(ideal[:-1], abs=0.05)
    assert measured[-1, :, 2].max() < 0.05
