"""Connects the vehicles of a fleet by the driver."""

from collections.abc import Iterable
from concurrent.futures import Future
from functools import partial

from std_msgs.msg import Float32
from typing_extensions import override

from crazyflie_driver.add_node import command_again
from crazyflie_driver.driver_parameters import (
    ADD,
    POSITIONING_PARAMETER,
    STANDARD_TOPICS,
    VehicleParameters,
)
from crazyflie_driver.positioning import FLOW
from crazyflie_driver.srv import (
    AddCrazyflie,
    UpdateParams,
    UpdateParamsRequest,
    WriteLighthouse,
    WriteLighthouseRequest,
)
from crazyflie_fleet.fleet_config import FleetConfig, VehicleConfig
from crazyflie_fleet.fleet_parameters import FleetParameters
from crazyflie_fleet.vehicle_nodes import PLACE
from crazyflie_utils import Node, NodeHandle, ParameterError, ServiceError, parameter
from crazyflie_utils.parameters.types import TEXT, ListOf
from crazyflie_utils.steps import follow
from crazyflie_utils.text_file import user_path

_PERIOD = 30.0  #: Least time between two reports about one vehicle (s).


class BatteryReportNode(Node):
    """Logs that the battery of a vehicle is below a voltage of the fleet file."""

    def __init__(self, vehicles: Iterable[VehicleConfig]):
        self._vehicles = [each for each in vehicles if not each.voltages_act]

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """Load none."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        for vehicle in self._vehicles:
            handle.subscribe(f"/{vehicle.name}/battery", Float32, partial(self._report, vehicle))

    def _report(self, vehicle, message):
        voltage = message.data
        for name in ("voltage_critical", "voltage_warning"):
            limit = getattr(vehicle, name)
            if voltage < limit:
                self._handle.warn(
                    f"{vehicle.name}: the battery has {voltage:.2f} V; {name} of the fleet file is "
                    f"{limit:g} V",
                    throttle=_PERIOD,
                    key=(vehicle.name, name),
                )
                return


#: Services of each vehicle that the fleet offers, and the driver, too, below /NAME/driver if the
#: fleet's are there first: the master knows the latest node only.
FLEET_SERVICES = ("takeoff", "land", "go_to", "emergency")
FLEET_LIMIT = 20.0  #: Longest wait for them (s).
_FLEET_PERIOD = 0.2  #: Period at which the master is asked for them (s).

TIMEOUT = 60.0  #: Timeout of the driver's start, connections, and writing of parameters (s).


def connection(vehicle: VehicleConfig) -> VehicleParameters:
    """Return the driver's parameters of a vehicle: its address and its log topics."""
    switches = {
        f"enable_logging_{topic}": topic in vehicle.default_topics for topic in STANDARD_TOPICS
    }
    topics = vehicle.log_topics
    return VehicleParameters.from_mapping(
        {
            "uri": vehicle.uri,
            "tf_prefix": vehicle.name,
            "positioning": vehicle.positioning,
            **switches,
            "genericLogTopics": [*topics],
            "genericLogTopicFrequencies": [round(1000.0 / t.frequency) for t in topics.values()],
            "genericLogTopic_NAME_Variables": [list(t.variables) for t in topics.values()],
        }
    )


class FleetConnectParameters(FleetParameters):
    """Parameters of `FleetConnectNode`."""

    vehicles: tuple[str, ...] = parameter(
        ListOf(TEXT), "names of the vehicles to add; empty for all of the machine", ()
    )

    @override
    def own_names(self, fleet: FleetConfig) -> tuple[str, ...]:
        names = super().own_names(fleet)
        unknown = [name for name in self.vehicles if name not in names]
        if unknown:
            raise ParameterError(
                f"parameter vehicles has {', '.join(unknown)}; expected names among "
                f"{', '.join(names)}"
            )
        return self.vehicles or names


class FleetConnectNode(Node):
    """Connects vehicles, writes their base stations and their firmware parameters.

    The process ends with status 0 when all are connected, else with 1, and names the others.
    The driver itself writes the parameters again after a reconnection.
    """

    needs_master = True

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        parameters = handle.load(FleetConnectParameters)
        fleet = parameters.fleet()
        self._vehicles = [fleet[name] for name in parameters.own_names(fleet)]
        for vehicle in self._vehicles:
            handle.set_param(f"/{vehicle.name}/{PLACE}", fleet.names.index(vehicle.name))
        missing = [vehicle.name for vehicle in self._vehicles if vehicle.uri is None]
        if missing:
            raise ParameterError(
                f"{parameters.file}: {', '.join(missing)} has no uri; expected one"
            )
        self._lighthouse_files = {
            vehicle.name: lighthouse_file(parameters.file, vehicle)
            for vehicle in self._vehicles
            if vehicle.lighthouse
        }
        self._connections = {vehicle.name: connection(vehicle) for vehicle in self._vehicles}

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._open = {vehicle.name for vehicle in self._vehicles}
        self._failed: list[str] = []
        self._wait = FLEET_LIMIT
        self._timer = handle.timer(_FLEET_PERIOD, self._add_after_fleet, steady=True)
        self._add_after_fleet()

    def _add_after_fleet(self):
        """Add the vehicles once the fleet offers its services."""
        handle, services = self._handle, self._handle.service_nodes()
        wanted = [f"/{each.name}/{name}" for each in self._vehicles for name in FLEET_SERVICES]
        missing = [name for name in wanted if name not in services]
        self._wait -= _FLEET_PERIOD
        if missing and self._wait > 0.0:
            return
        self._timer.stop()
        if missing:
            handle.warn(
                f"the fleet does not offer {missing[0]} after {FLEET_LIMIT:g} s; if it starts "
                "later, its services and the driver's take each other's names"
            )
        for vehicle in self._vehicles:
            connection = self._connections[vehicle.name]
            handle.set_param(f"{connection.prefix}/{POSITIONING_PARAMETER}", connection.positioning)
            connected = follow(self._connect(vehicle), handle.submit)
            connected.add_done_callback(partial(handle.submit, self._finish, vehicle))

    def _connect(self, vehicle):
        """Connect a vehicle, in steps."""
        handle, name = self._handle, vehicle.name
        yield handle.call_service(ADD, AddCrazyflie, self._connections[name].request(), TIMEOUT)
        if file := self._lighthouse_files.get(name):
            request = WriteLighthouseRequest(file)
            service = f"/{name}/write_lighthouse"
            yield handle.call_service(service, WriteLighthouse, request, TIMEOUT)
        params = dict(vehicle.firmware_params)
        if vehicle.has_single_marker:
            # Only the Kalman filter uses external positions, and estimates the yaw from them.
            params.setdefault("stabilizer.estimator", 2)
        if vehicle.positioning == FLOW:
            # The deck measures no position: the estimate begins at the vehicle's start point.
            x, y, z = vehicle.position
            start = {"kalman.initialX": x, "kalman.initialY": y, "kalman.initialZ": z}
            params = {**start, **params, "kalman.resetEstimation": 1}
        if params:
            values = {key.replace(".", "/"): value for key, value in params.items()}
            yield from [self._write(f"/{name}/{key}", value) for key, value in values.items()]
            request = UpdateParamsRequest([*values])
            yield handle.call_service(f"/{name}/update_params", UpdateParams, request, TIMEOUT)

    def _write(self, name, value):
        """Return the future of a parameter's writing; it fails if the master does not answer."""
        outcome: Future[None] = Future()

        def give_up():
            timer.stop()
            if not outcome.done():
                text = f"parameter {name} has not been written within {TIMEOUT:g} s"
                outcome.set_exception(ServiceError(text))

        def finish(written):
            timer.stop()
            if outcome.done():
                return
            if error := written.exception():
                outcome.set_exception(error)
            else:
                outcome.set_result(None)

        timer = self._handle.timer(TIMEOUT, give_up, steady=True)
        written = self._handle.set_param_later(name, value)
        # The writer's own future stays its own: it may complete it after the limit.
        written.add_done_callback(partial(self._handle.submit, finish))
        return outcome

    def _finish(self, vehicle, done):
        if (error := done.exception()) is None:
            self._handle.info(f"{vehicle.name} is connected, {vehicle.uri}")
        else:
            self._failed.append(vehicle.name)
            self._handle.error(f"{vehicle.name}, {vehicle.uri}: {error}")
        self._open.discard(vehicle.name)
        if self._open:
            return
        if self._failed:
            again = command_again(self._handle, "crazyflie_fleet", "fleet_add_node")
            missing = sorted(self._failed)
            self._handle.error(
                f"vehicles are not connected: {', '.join(missing)}; to try again: {again} "
                f"_vehicles:='[{', '.join(missing)}]'"
            )
        self._handle.end(1 if self._failed else 0)


def lighthouse_file(fleet_file: str, vehicle: VehicleConfig) -> str:
    """Return the file with the base stations of a vehicle of a fleet file.

    `ParameterError`: there is no such file.
    """
    file = user_path(fleet_file).resolve().parent / user_path(vehicle.lighthouse)
    if not file.is_file():
        raise ParameterError(
            f"{fleet_file}: lighthouse of {vehicle.name} is {vehicle.lighthouse!r}, and "
            f"there is no file {file}; expected one, relative to the fleet file"
        )
    return str(file)
