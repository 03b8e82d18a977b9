"""Simulated vehicles with all their nodes on a fake process, and missions that fly them."""

from pathlib import Path

import numpy as np
import rospkg
from fake_fleet import fake_process

from crazyflie_fleet.fleet_process import make_nodes
from crazyflie_mission_api import Fleet

GAINS = Path(rospkg.RosPack().get_path("crazyflie_lqr")) / "config"
NODES = {
    "simulator": {"time_step": 0.02},
    "state_estimator": {"time_step": 0.02},
    "lqr_controller": {
        "K_file": str(GAINS / "K_sim.txt"),
        "u_ref_file": str(GAINS / "u_ref_hover.txt"),
    },
}


class Swarm:
    """The vehicles of `sw_swarm.launch`, cf1, cf2, ..., at their start points (m)."""

    def __init__(self, monkeypatch, tmp_path, places, buffer=0.15):
        self.process = fake_process(monkeypatch)
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
        return Fleet(self.names, process=self.process, startup_timeout=1.0, **options)

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
