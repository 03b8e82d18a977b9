"""Imports of scripts, without ROS."""

import subprocess
import sys

import numpy as np
import pycrazyswarm.cfsim.cffirmware
import pytest
import uav_trajectory
from pycrazyswarm.util import check_ellipsoid_collisions, grid_yaml, poisson_disk_sample
from sim import PAIR

import crazyflie_py
import crazyflie_py.uav_trajectory

NAMES = [
    "from pycrazyswarm import *; Crazyswarm",
    "from crazyflie_py import *; Crazyswarm",
    "from pycrazyswarm.crazyflie import Crazyflie, CrazyflieServer, TimeHelper",
    "from pycrazyswarm.crazyflieSim import Crazyflie, CrazyflieServer, TimeHelper",
    "from pycrazyswarm.crazyswarm import Crazyswarm, build_argparser",
    "from pycrazyswarm.crazyswarm_py import Crazyswarm",
    "import pycrazyswarm.util; pycrazyswarm.util.normalize",
    "import pycrazyswarm.uav_trajectory as uav; uav.Trajectory",
    "from crazyflie_py.crazyswarm_py import Crazyswarm",
    "from crazyflie_py.crazyflie import Crazyflie, CrazyflieServer, TimeHelper",
    "import pycrazyswarm.cfsim.cffirmware as firm",
    "from crazyflie_py.uav_trajectory import Trajectory, Polynomial4D",
    "from pycrazyswarm.util import *; check_ellipsoid_collisions, grid_yaml",
    "from pycrazyswarm import util; util.poisson_disk_sample, util.clamp_norm, util.normalize",
]


@pytest.mark.parametrize("line", NAMES)
def test_a_line_of_scripts(line):
    exec(line, {})


def test_bindings_of_the_firmware_are_not_here():
    with pytest.raises(AttributeError, match="cffirmware has no mkvec: .* expected functions of"):
        pycrazyswarm.cfsim.cffirmware.mkvec  # noqa: B018


def test_names_of_one_thing():
    assert pycrazyswarm.Crazyswarm is crazyflie_py.Crazyswarm
    assert uav_trajectory.Trajectory is crazyflie_py.uav_trajectory.Trajectory


def test_sim_needs_neither_ros_nor_matplotlib():
    script = f"""
import sys
from pycrazyswarm import Crazyswarm
swarm = Crazyswarm({PAIR!r}, args=["--sim", "--vis", "null"])
swarm.allcfs.takeoff(1.0, 1.0)
swarm.timeHelper.sleep(1.0)
print([name for name in sys.modules if name.partition(".")[0] in
       ("rospy", "roslib", "rosgraph", "genpy", "tf2_ros", "matplotlib", "geometry_msgs")])
"""
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True
    )
    assert run.stdout == "[]\n"


def test_a_fleet_file_of_either_layout(tmp_path):
    text = """
robots:
  cf231: {uri: radio://0/80/2M/E7E7E7E7E7, initial_position: [0.5, 1.0, 0.0], type: cf21}
  cf5: {enabled: false, uri: radio://0/80/2M/E7E7E7E705, initial_position: [0, 0, 0], type: cf21}
  one: {uri: "radio://0/80/2M/E7E7E7E70A?rate_limit=100", initial_position: [1, 0, 0], type: cf21}
robot_types: {cf21: {motion_capture: {enabled: true}}}
"""
    path = tmp_path / "crazyflies.yaml"
    path.write_text(text)
    for fleet in (text, str(path), path):
        swarm = crazyflie_py.Crazyswarm(crazyflies_yaml=fleet, args="--sim --vis null")
        assert list(swarm.allcfs.crazyfliesById) == [0xE7, 0x0A]
        assert list(swarm.allcfs.crazyfliesByName) == ["cf231", "one"]
        assert swarm.allcfs.crazyfliesById[10].initialPosition == pytest.approx([1.0, 0.0, 0.0])
        assert swarm.timeHelper.crazyflies == swarm.allcfs.crazyflies


def test_without_a_fleet_file_it_is_where_crazyswarm_has_it(tmp_path, monkeypatch):
    for name in ("launch", "scripts"):
        (tmp_path / name).mkdir()
    (tmp_path / "launch" / "crazyflies.yaml").write_text(PAIR)
    monkeypatch.setattr(sys, "argv", [str(tmp_path / "scripts" / "fly.py"), "--sim", "--vis=null"])
    assert len(crazyflie_py.Crazyswarm().allcfs.crazyflies) == 2
    monkeypatch.setattr(sys, "argv", ["fly.py", "--sim", "--vis=null", "--mine", "3"])
    monkeypatch.chdir(tmp_path / "scripts")
    assert len(crazyflie_py.Crazyswarm().allcfs.crazyflies) == 2


def test_states_as_crazyswarm2_has_them():
    swarm = crazyflie_py.Crazyswarm(PAIR, args="--sim --vis null")
    one = swarm.allcfs.crazyfliesByName["cf1"]
    one.cmdPosition([0.1, 0.2, 0.3], yaw=np.pi / 2)
    swarm.timeHelper.sleep(0.1)
    assert one.get_position() == pytest.approx([0.1, 0.2, 0.3])
    pose = one.get_pose()
    assert (pose["position"].x, pose["position"].z) == pytest.approx((0.1, 0.3))
    assert (pose["orientation"].z, pose["orientation"].w) == pytest.approx((0.5**0.5, 0.5**0.5))
    status = one.get_status()
    assert status["id"] == "cf1"
    assert status["battery"] > 3.7
    assert {"supervisor", "pm_state", "rssi", "num_rx_unicast", "timestamp_sec"} <= set(status)
    swarm.allcfs.arm(False)
    assert not one.get_status()["supervisor"] & 0b10


def test_ellipsoids_that_intersect():
    positions = np.array([[0.0, 0.0, 0.0], [0.24, 0.0, 0.0], [0.0, 0.0, 0.76], [3.0, 0.0, 0.0]])
    radii = np.array([0.125, 0.125, 0.375])
    assert check_ellipsoid_collisions(positions, radii).tolist() == [True, True, False, False]
    positions[2, 2] = 0.74
    assert check_ellipsoid_collisions(positions, radii).tolist() == [True, True, True, False]


def test_samples_keep_their_distance():
    points = poisson_disk_sample(20, dim=2, mindist=0.5)
    assert points.shape == (20, 2)
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1) + np.eye(20)
    assert distances.min() >= 0.5


def test_a_grid_is_a_fleet_file():
    swarm = crazyflie_py.Crazyswarm(grid_yaml(2, 3, spacing=0.5), args="--sim --vis null")
    starts = np.array([cf.initialPosition for cf in swarm.allcfs.crazyflies])
    assert len(starts) == 6
    assert starts.mean(axis=0) == pytest.approx([0.0, 0.0, 0.0])
    assert np.ptp(starts, axis=0) == pytest.approx([0.5, 1.0, 0.0])


def test_a_script_beside_its_own_pycrazyswarm(tmp_path):
    own = tmp_path / "pycrazyswarm"
    own.mkdir()
    (own / "__init__.py").write_text("Crazyswarm = 'their own'\n")
    script = tmp_path / "script.py"
    script.write_text("from pycrazyswarm import Crazyswarm\nprint(Crazyswarm)\n")

    def printed(*options):
        command = [sys.executable, *options, script]
        return subprocess.run(command, capture_output=True, text=True, timeout=60).stdout

    # As docs/migrating.md says.
    assert printed() == "their own\n"
    assert printed("-P") == "<class 'crazyflie_py.crazyswarm_py.Crazyswarm'>\n"
