"""One vehicle of the server: its link, topics and services, from adding to removing."""

from concurrent.futures import Future

from crazyflie_driver.battery import Battery
from crazyflie_driver.connection import Connection
from crazyflie_driver.delivery import Delivery
from crazyflie_driver.emergency import Emergency
from crazyflie_driver.flight_commands import FlightCommands
from crazyflie_driver.flight_state import FlightState
from crazyflie_driver.jobs import Jobs
from crazyflie_driver.landings import Landings
from crazyflie_driver.lifecycle import Lifecycle
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.parameter_mirror import ParameterMirror
from crazyflie_driver.server_parameters import CrazyflieServerParameters
from crazyflie_driver.services import VehicleServices
from crazyflie_driver.setpoint_gate import SetpointGate
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.shutdown import Shutdown
from crazyflie_driver.status_publisher import StatusPublisher
from crazyflie_driver.vehicle_parameters import VehicleParameters
from crazyflie_link.crazyflie import Crazyflie
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
        self._limit = server.connect_limit
        own = handle.child()
        self.crazyflie = crazyflie = Crazyflie(
            parameters.uri,
            reconnect=True,
            on_state=lambda state, text: self._lifecycle.on_link_state(state, text),
            on_console=lambda line: own.info(f"{name}: {line}"),
            on_packet=lambda *packet: self._lifecycle.on_packet(*packet),
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
        frame = server.fixed_frame
        self._log = log = LogTopics(
            own, parameters, crazyflie, delivery, frame, lambda: self._lifecycle.on_log()
        )
        self.setpoints = setpoints = SetpointTopics(own, parameters, crazyflie, log, gate)
        self.flight = flight = FlightState(own, crazyflie, log, setpoints)
        self.status = status = StatusPublisher(
            own, prefix, crazyflie, log, setpoints, battery, connection
        )
        self.emergency = emergency = Emergency(crazyflie, gate, jobs, status.publish)
        self.commands = commands = FlightCommands(
            own, name, crazyflie, setpoints, flight, battery, emergency, jobs, server
        )
        self.landings = landings = Landings(
            own, name, battery, log, setpoints, commands, server.landing_duration
        )
        mirror = ParameterMirror(own, prefix, crazyflie)
        services = VehicleServices(
            own, name, prefix, crazyflie, jobs, gate, flight, commands, emergency, mirror
        )
        self._lifecycle = Lifecycle(
            own,
            parameters,
            connection,
            log,
            setpoints,
            flight,
            battery,
            commands,
            landings,
            mirror,
            services,
            status,
        )
        self._shutdown = Shutdown(own, name, crazyflie, emergency, flight, setpoints, landings)
        status.publish()

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
        return self.jobs.submit("connecting", lambda _: self._lifecycle.connect(self._limit))

    def remove(self, limit: float) -> Future[str]:
        """Land, stop the motors, end the link, take topics and services down.

        Also while the vehicle is being connected, or its jobs are blocked by it. The limit (s) is
        that of a landing: the vehicle lands without its link, too. The result is what could not be
        done.
        """
        self._connection.is_closing = True
        self.status.publish_connected(False)
        return self._connection.close(lambda: self._shutdown.land_or_stop(limit))
