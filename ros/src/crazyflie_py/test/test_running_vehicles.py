"""Scripts on the vehicles of a simulated fleet, on a fake process."""

from pathlib import Path

import pytest
import rospkg

from crazyflie_fleet import fleet_process
from crazyflie_mission_api import fleet
from crazyflie_py import ros_backend
from crazyflie_py.crazyflie import CrazyflieServer
from crazyflie_py.crazyswarm_py import build_argparser
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
    return lambda: CrazyflieServer(ros_backend.RosBackend(None, options, process))


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
    assert "setParam: usd.logging is no parameter that the simulation knows" in record.message
