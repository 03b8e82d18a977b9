"""Simulated vehicles with all their nodes on a fake process, and missions that fly them."""

from pathlib import Path

import numpy as np
import rospkg

from crazyflie_fleet.process import make_nodes
from crazyflie_mission_api import Fleet
from crazyflie_mission_api import fleet as fleet_module
from crazyflie_utils.testing import FakeProcess

GAINS = Path(rospkg.RosPack().get_path("crazyflie_lqr")) / "config"
NODES = {
    "simulator": {"time_step": 0.02},
    "state_estimator": {"time_step": 0.02},
    "lqr_controller": {
        "K_file": str(GAINS / "K_hover.txt"),
        "u_ref_file": str(GAINS / "u_ref_hover.txt"),
    },
}


class FakeClock:
    """Time that passes when somebody waits."""

    def __init__(self, handle, has_ended):
        self._process = handle._process

    def time(self):
        return self._process.clock.time()

    def wait_until(self, condition, deadline):
        while not (done := condition()) and self.time() < deadline:
            self._process.advance(0.05)
        return done


class Swarm:
    """What `sw_swarm.launch` flies: vehicles cf1, cf2, ... where they stand, m."""

    def __init__(self, monkeypatch, tmp_path, places, buffer=0.15):
        monkeypatch.setattr(fleet_module, "RosClock", FakeClock)
        monkeypatch.setattr(fleet_module, "topic_types", lambda handle: {})
        self.process = FakeProcess()
        monkeypatch.setattr(self.process, "start", lambda: self.process.advance(0.1))
        file = tmp_path / "fleet.yaml"
        self.names = [f"cf{k}" for k in range(1, len(places) + 1)]
        robots = (
            f"  {name}: {{initial_position: {list(map(float, place))}, buffer: {buffer}}}\n"
            for name, place in zip(self.names, places, strict=True)
        )
        file.write_text("robots:\n" + "".join(robots))
        parameters = {"simulated": True, "nodes": NODES, "fleet": {"file": str(file)}}
        self.process.transport.set_param("/fleet", parameters)
        for name, node in make_nodes(self.process.handle("/fleet")).items():
            assert self.process.launch(node, name), self.process.logged("error")
        self.process.advance(0.6)

    def fleet(self, **options):
        """Return the fleet of a mission."""
        return Fleet(self.names, process=self.process, limit=1.0, **options)

    def track(self, name):
        """Return where a vehicle was, shape (n, 3), m."""
        states = [message.state for message in self.process.published(f"/{name}/state")]
        return np.array([(s.x, s.y, s.z) for s in states])

    def nearest(self):
        """Return the least distance that two vehicles had, m; heights count for half."""
        tracks = [self.track(name) * (1.0, 1.0, 0.5) for name in self.names]
        n = min(map(len, tracks))
        return min(
            np.linalg.norm(a[-n:] - b[-n:], axis=1).min()
            for k, a in enumerate(tracks)
            for b in tracks[:k]
        )
