"""A simulated fleet with all its nodes on a fake process."""

from concurrent.futures import Future
from pathlib import Path

import rospkg
from std_srvs.srv import EmptyRequest

from crazyflie_fleet.fleet_process import make_nodes
from crazyflie_utils.testing import FakeProcess

GAINS = Path(rospkg.RosPack().get_path("crazyflie_lqr")) / "config"
NODES = {
    "simulator": {"time_step": 0.02},
    "state_estimator": {"time_step": 0.02},
    "takeoff_server": {"duration": {"hover": 3.0}},
    "lqr_controller": {
        "K_file": str(GAINS / "K_sim.txt"),
        "u_ref_file": str(GAINS / "u_ref_hover.txt"),
    },
}


class Swarm:
    """A simulated fleet."""

    def __init__(self, nodes=NODES, **parameters):
        self.process = FakeProcess()
        self.process.transport.set_param(
            "/fleet", {"simulated": True, "nodes": nodes, **parameters}
        )
        self.nodes = make_nodes(self.process.handle("/fleet"))
        for name, node in self.nodes.items():
            assert self.process.launch(node, name), self.process.logged("error")
        self.process.advance(0.6)

    def call(self, service, request=None, seconds=4.6):
        """Return the answer, which comes within some seconds."""
        answer = self.process.call(service, request or EmptyRequest())
        if isinstance(answer, Future):
            self.advance_until(answer.done, seconds)
            answer = answer.result(0)
        return answer

    def advance_until(self, is_so, seconds):
        """Advance the time until a condition holds, or a limit is reached."""
        end = self.process.clock.time() + seconds
        while not is_so() and self.process.clock.time() < end:
            self.process.advance(min(0.5, end - self.process.clock.time()))

    def position(self, name):
        state = self.process.published(f"/{name}/state")[-1].state
        return state.x, state.y, state.z
