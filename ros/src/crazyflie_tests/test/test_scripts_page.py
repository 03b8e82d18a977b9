"""The three scripts of docs/scripts.md do the same."""

import importlib.util
import runpy
import sys

import numpy as np
import pytest
from workspaces import TOP

from crazyflie_driver.srv import GoToRequest
from crazyflie_mission_api import DryRun
from crazyflie_py.simulation import Simulation

EXAMPLES = TOP / "docs" / "examples" / "three_ways"
FLEET = """
crazyflies:
- {channel: 80, id: 1, initialPosition: [0.0, -0.5, 0.0]}
- {channel: 80, id: 2, initialPosition: [0.0, 0.5, 0.0]}
"""
ENDS = {"cf1": (0.5, -0.5), "cf2": (0.5, 0.5)}


def loaded(name):
    """Return a script as a module."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_crazyswarms_api(tmp_path, monkeypatch):
    (tmp_path / "launch").mkdir()
    (tmp_path / "scripts").mkdir()
    (tmp_path / "launch" / "crazyflies.yaml").write_text(FLEET)
    monkeypatch.chdir(tmp_path / "scripts")
    monkeypatch.setattr(sys, "argv", ["crazyswarm.py", "--sim", "--vis", "null"])
    simulations = []
    step = Simulation._step
    monkeypatch.setattr(Simulation, "_step", lambda self: (simulations.append(self), step(self)))
    runpy.run_path(str(EXAMPLES / "crazyswarm.py"), run_name="__main__")
    for vehicle in simulations[-1].vehicles:
        assert vehicle.motion.position[:2] == pytest.approx(ENDS[vehicle.name], abs=1e-4)
        assert vehicle.motion.position[2] == pytest.approx(0.04, abs=1e-4)


def test_a_mission():
    run = DryRun({name: (0.0, y, 0.0) for name, (_, y) in ENDS.items()})
    with run:
        loaded("mission").mission(run)
    for name, end in ENDS.items():
        assert run.position(name)[:2] == pytest.approx(end)
    assert not run.flying


def test_services(monkeypatch):
    script = loaded("ros_services")
    calls = []

    def proxy(name, service_type):
        def call(*arguments):
            # The request's constructor checks types and number of arguments.
            calls.append((name, service_type._request_class(*arguments)))

        return call

    monkeypatch.setattr(script.rospy, "init_node", lambda name: None)
    monkeypatch.setattr(script.rospy, "wait_for_service", lambda name, timeout: None)
    monkeypatch.setattr(script.rospy, "sleep", lambda duration: None)
    monkeypatch.setattr(script.rospy, "ServiceProxy", proxy)
    script.main()
    names = ["/all/takeoff", "/cf1/go_to", "/cf2/go_to", "/all/land"]
    assert [name for name, _ in calls] == names
    for _, request in calls[1:3]:
        assert isinstance(request, GoToRequest)
        assert request.relative
        goal = request.goal
        assert np.array([goal.x, goal.y, goal.z]) == pytest.approx([0.5, 0.0, 0.0])
        assert request.duration.to_sec() == 3.0
