"""ROS interface of the check that vehicles do not start at one place."""

from collections.abc import Collection

from std_msgs.msg import String
from typing_extensions import override

from crazyflie_fleet.fleet_config import FleetConfig, close_pairs
from crazyflie_fleet.references_node import VehicleStates
from crazyflie_fleet.vehicle_nodes import INHIBITION
from crazyflie_utils import Node, NodeHandle

_PERIOD = 0.2  #: Period of the checks (s).


class PlacementNode(Node):
    """Refuses takeoffs of vehicles with one start point in the fleet file until they are apart.

    ``names`` are of the vehicles that are flown in this process. A pair that has been measured
    apart is not checked again.
    """

    def __init__(self, names: Collection[str], fleet: FleetConfig, states: VehicleStates):
        self._fleet = fleet
        self._states = states
        self._pairs = list(fleet.unplaced)
        self._names = [name for name in names if any(name in pair for pair in self._pairs)]
        self._texts: dict[str, str] = {}

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """Load none."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publishers = {
            name: handle.publisher(f"/{name}/{INHIBITION}", String, latch=True)
            for name in self._names
        }
        self._update()
        handle.timer(_PERIOD, self._update)

    def _update(self):
        self._pairs = [pair for pair in self._pairs if self._reason(pair)]
        for name, publisher in self._publishers.items():
            text = next((self._reason(pair) for pair in self._pairs if name in pair), "")
            if self._texts.get(name) != text:
                self._texts[name] = text
                publisher.publish(String(text))

    def _reason(self, pair):
        """Return why the vehicles of a pair must not take off; empty if they are apart."""
        numbers = [self._states.numbers[name] for name in pair]
        are_seen = self._states.are_fresh()[numbers].all()
        what = f"{pair[0]} and {pair[1]} start at one place by the fleet file"
        buffers = [self._fleet[name].buffer for name in pair]
        if not are_seen:
            return f"{what}, and the positions of both are not known"
        for _, _, distance, limit in close_pairs(self._states.positions[numbers], buffers):
            return f"{what}, and are {distance:.2f} m apart; expected at least {limit:.2f} m"
        return ""
