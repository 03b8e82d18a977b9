"""One vehicle of the server: its link, topics and services, from adding to removing."""

from concurrent.futures import Future

from crazyflie_driver.battery import Battery
from crazyflie_driver.connection import Connection
from crazyflie_driver.delivery import Delivery
from crazyflie_driver.emergency import Emergency
from crazyflie_driver.flight_commands import FlightCommands
from crazyflie_driver.flight_state import FlightState
from crazyflie_driver.jobs import Jobs
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.parameter_mirror import ParameterMirror
from crazyflie_driver.server_parameters import CrazyflieServerParameters
from crazyflie_driver.service_names import ServiceNames
from crazyflie_driver.services import VehicleServices
from crazyflie_driver.setpoint_gate import Event, SetpointGate
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.setup_services import SetupServices
from crazyflie_driver.shutdown import Shutdown
from crazyflie_driver.status_publisher import StatusPublisher
from crazyflie_driver.vehicle_parameters import VehicleParameters
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_utils import NodeHandle


class DriverVehicle:
    """A vehicle that is being connected, is connected, or has lost its link.

    What takes time are jobs of the vehicle's own, so that no vehicle blocks another. Raises
    `CrazyflieError` if the address is malformed.
    """

    def __init__(
        self,
        handle: NodeHandle,
        parameters: VehicleParameters,
        server: CrazyflieServerParameters,
    ):
        name, prefix = parameters.name, parameters.prefix
        self.parameters = parameters
        self._handle = handle
        self._server = server
        own = handle.child()
        self.crazyflie = crazyflie = Crazyflie(
            parameters.uri,
            reconnect=True,
            on_state=self._on_link_state,
            on_console=lambda line: own.info(f"{name}: {line}"),
            on_packet=self._on_packet,
        )
        gate = SetpointGate()
        self.jobs = jobs = Jobs(name, lambda text: handle.error(f"{name}: {text}"))
        self.battery = battery = Battery(
            server.battery_low, server.battery_critical, server.battery_critical_time
        )
        delivery = Delivery(own, name)
        self._connection = connection = Connection(
            handle, own, name, crazyflie, gate, jobs, delivery, lambda: self.status.publish()
        )
        self._log = log = LogTopics(
            own, parameters, crazyflie, delivery, server.fixed_frame, self._on_log_status
        )
        self.setpoints = setpoints = SetpointTopics(own, parameters, crazyflie, log, gate)
        self.flight = flight = FlightState(own, crazyflie, log, setpoints)
        self.status = StatusPublisher(own, prefix, crazyflie, log, setpoints, battery, connection)
        self.emergency = emergency = Emergency(crazyflie, gate, jobs, self.status.publish)
        self.commands = FlightCommands(
            own, name, crazyflie, setpoints, flight, battery, emergency, jobs, server
        )
        self._mirror = mirror = ParameterMirror(own, prefix, crazyflie)
        self._names = names = ServiceNames(own, prefix)
        self._services = VehicleServices(
            own,
            name,
            names,
            crazyflie,
            jobs,
            gate,
            flight,
            self.commands,
            emergency,
            mirror,
            SetupServices(crazyflie, jobs, flight, emergency, mirror),
        )
        duration = server.landing_duration
        self._shutdown = Shutdown(crazyflie, emergency, flight, setpoints, duration, self._warn)
        self.status.publish()

    @property
    def is_closing(self) -> bool:
        """Whether the vehicle is being removed."""
        return self._connection.is_closing

    @property
    def is_ready(self) -> bool:
        """Whether the vehicle has been connected, and its services are there."""
        return self._connection.is_established and not self.is_closing

    def connect(self) -> Future[None]:
        """Connect and announce all topics and services; the result is None.

        The future fails with `ServiceError` when that is not possible; then nothing
        remains of the vehicle.
        """
        return self.jobs.submit(
            "connecting",
            lambda _: self._connection.connect(
                self._server.connect_limit, self._wait_for_controllers, self._announce
            ),
        )

    def remove(self, limit: float) -> Future[str]:
        """Land, stop the motors, end the link, take topics and services down.

        Also while the vehicle is being connected, or its jobs are blocked by it. The limit (s) is
        that of a landing: the vehicle lands without its link, too. The result is what could not be
        done.
        """
        self._connection.is_closing = True
        self.status.publish_connected(False)
        return self._connection.close(lambda: self._shutdown.land_or_stop(limit))

    def _wait_for_controllers(self):
        self._names.wait_for_controllers(lambda: self.is_closing)

    def _announce(self):
        self._log.start()
        if self.parameters.enable_parameters:
            self._mirror.publish()
        if not self.emergency.is_latched:
            self.setpoints.open_thrust_lock(self.flight.read())
        self._services.advertise()
        self.setpoints.subscribe()
        self.commands.start()

    def _resume(self):
        for problem in self._mirror.reapply_parameters():
            self._warn(f"not written again: {problem}")
        if self.parameters.enable_parameters:
            self._mirror.publish()
        self.setpoints.open_thrust_lock(self.flight.read())

    def _warn(self, text):
        self._handle.warn(f"{self.parameters.name}: {text}")

    # What comes from the vehicle.

    def _on_log_status(self):
        voltage = self._log.voltage
        if voltage is not None:
            self.battery.update(voltage, self._handle.time())
            self.commands.check_battery()
        if self.flight.is_flying and self.crazyflie.state is LinkState.CONNECTED:
            self.setpoints.gate.handle(Event.FLIGHT_REPORTED)
        self.setpoints.check_lift()
        self.status.publish()

    def _on_link_state(self, state, text):
        if state is LinkState.LOST:
            # The state before the loss is not that of now.
            self._log.supervisor = None
            self._log.variances.clear()
        self._connection.on_state(state, text, self._resume)

    def _on_packet(self, port, channel, data):
        if not self.is_closing:
            self._log.publish_packet(port, channel, data)
