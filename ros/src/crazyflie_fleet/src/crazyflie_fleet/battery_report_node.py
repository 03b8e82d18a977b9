"""ROS interface of the voltages of a fleet file that are reported, and do not act."""

from collections.abc import Iterable
from functools import partial

from std_msgs.msg import Float32
from typing_extensions import override

from crazyflie_fleet.fleet_config import VehicleConfig
from crazyflie_utils import Node, NodeHandle

_PERIOD = 30.0  #: Between two reports about one vehicle, s.


class BatteryReportNode(Node):
    """Log that the battery of a vehicle is below a voltage of the fleet file."""

    def __init__(self, vehicles: Iterable[VehicleConfig]):
        self._vehicles = [each for each in vehicles if not each.settings.voltages_act]

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """Load none."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        for vehicle in self._vehicles:
            handle.subscribe(f"/{vehicle.name}/battery", Float32, partial(self._report, vehicle))

    def _report(self, vehicle, message):
        settings, voltage = vehicle.settings, message.data
        for name in ("voltage_critical", "voltage_warning"):
            limit = getattr(settings, name)
            if voltage < limit:
                self._handle.warn(
                    f"{vehicle.name}: the battery has {voltage:.2f} V; {name} of the fleet file is "
                    f"{limit:g} V",
                    throttle=_PERIOD,
                    key=(vehicle.name, name),
                )
                return
