"""What follows when a vehicle is connected, has a new link, or logs its state."""

from dataclasses import dataclass

from crazyflie_driver.battery import Battery
from crazyflie_driver.connection import Connection
from crazyflie_driver.flight_commands import FlightCommands
from crazyflie_driver.flight_state import FlightState
from crazyflie_driver.landings import Landings
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.parameter_mirror import ParameterMirror
from crazyflie_driver.services import VehicleServices
from crazyflie_driver.setpoint_gate import Event
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.status_publisher import StatusPublisher
from crazyflie_driver.vehicle_parameters import VehicleParameters
from crazyflie_link.crazyflie import LinkState
from crazyflie_utils import NodeHandle


@dataclass(eq=False)
class Lifecycle:
    """Announce a vehicle's topics and services, and follow its link and its log."""

    _handle: NodeHandle
    _parameters: VehicleParameters
    _connection: Connection
    _log: LogTopics
    _setpoints: SetpointTopics
    _flight: FlightState
    _battery: Battery
    _commands: FlightCommands
    _landings: Landings
    _mirror: ParameterMirror
    _services: VehicleServices
    _status: StatusPublisher

    def connect(self, limit: float) -> None:
        """Connect within a limit (s), then announce everything; see `Connection.connect`."""
        self._connection.connect(limit, self._wait_for_names, self._announce)

    def on_link_state(self, state: LinkState, text: str) -> None:
        """Take note of the link's state, and why it is that; from the link's own thread."""
        if state is LinkState.LOST:
            # The state before the loss is not that of now.
            self._log.supervisor = None
            self._log.variances.clear()
        self._connection.on_state(state, text, self._resume)

    def on_packet(self, port: int, channel: int, data: bytes) -> None:
        """Publish a packet of the vehicle."""
        if not self._connection.is_closing:
            self._log.publish_packet(port, channel, data)

    def on_log(self) -> None:
        """Take note of what the vehicle has logged about itself."""
        voltage = self._log.voltage
        if voltage is not None:
            self._battery.update(voltage, self._handle.time())
        self._landings.follow()
        if self._flight.is_flying and self._connection.is_connected:
            self._setpoints.gate.handle(Event.FLIGHT_REPORTED)
        self._setpoints.check_lift()
        self._status.publish()

    def _wait_for_names(self):
        self._services.wait_for_names(lambda: self._connection.is_closing)

    def _announce(self):
        self._log.start()
        if self._parameters.enable_parameters:
            self._mirror.publish()
        if not self._setpoints.gate.is_emergency:
            self._setpoints.open_thrust_lock(self._flight.read())
        self._services.advertise()
        self._setpoints.subscribe()
        self._commands.start()

    def _resume(self):
        for problem in self._mirror.reapply_parameters():
            self._handle.warn(f"{self._parameters.name}: not written again: {problem}")
        if self._parameters.enable_parameters:
            self._mirror.publish()
        self._setpoints.open_thrust_lock(self._flight.read())
