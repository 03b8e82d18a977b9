"""One vehicle of the server: its link, topics and services, from adding to removing."""

import dataclasses
from concurrent.futures import Future, wait

from crazyflie_driver.commands import CommandedFlight
from crazyflie_driver.driver_parameters import (
    POSITIONING_PARAMETER,
    CrazyflieServerParameters,
    VehicleParameters,
)
from crazyflie_driver.flight_commands import FlightCommands, Reason
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.positioning import MOCAP, SOURCES
from crazyflie_driver.services import ParameterMirror, VehicleServices
from crazyflie_driver.setpoint_gate import GateEvent, SetpointGate
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.status import StatusPublisher
from crazyflie_driver.vehicle_base import (
    BaseVehicle,
    ConnectionEvent,
    ConnectionState,
    Delivery,
    Job,
    Jobs,
    awaited,
)
from crazyflie_driver.vehicle_link import vehicle_link
from crazyflie_link.crazyflie import LinkState
from crazyflie_link.errors import CrazyflieError, LinkLostError
from crazyflie_link.transmission import REPLY_LIMIT
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle, ServiceError
from crazyflie_utils.parameters.types import Text

_EMERGENCY_LIMIT = 1.0  #: Time limit of the vehicle's confirmation of an emergency stop, s.
_LOOK_PERIOD = 0.1
_RESET_TIME = 0.2  #: Time after which no estimate from before its reset comes any more, s.
_CALL_AGAIN = "call update_params once it is on the ground"
_ELSEWHERE = (
    "the vehicle has restarted, and its estimate has not begun at its initial position; call "
    "update_params with kalman/initialX and so on, and kalman/resetEstimation"
)
_REACTION_TIME = 0.3  #: Time after which the vehicle has begun to land, s.


class DriverVehicle(BaseVehicle):
    """A vehicle that is being connected, is connected, or has lost its link.

    Calls that take time are jobs of the vehicle, so that no vehicle blocks another. Raises
    `CrazyflieError` if the address is malformed.
    """

    log: LogTopics

    def __init__(
        self, handle: NodeHandle, parameters: VehicleParameters, server: CrazyflieServerParameters
    ):
        name, own = parameters.name, handle.child()
        super().__init__(
            own,
            parameters,
            server,
            vehicle_link(
                own,
                name,
                parameters.uri,
                on_state=lambda state, text: self._pass_link_state(state, text),
                on_console=self.info,
                on_packet=lambda *packet: self.log.publish_packet(*packet),
            ),
            SetpointGate(),
            Jobs(name, own.task, self.error),
            Delivery(own, name),
            link_text=f"connecting to {parameters.uri}",
        )
        self._deliver_link_state = self.delivery.outlet(self._on_link_state)
        self.log = LogTopics(self, self._on_log)
        self.setpoints = SetpointTopics(self, self.log)
        self.flight = CommandedFlight(self, self.log, self.setpoints)
        self.status = StatusPublisher(self, self.log, self.setpoints)
        self.commands = FlightCommands(self, self.log, self.setpoints, self.flight)
        self._mirror = ParameterMirror(
            own, parameters.prefix, self.crazyflie, self._on_estimate_reset
        )
        self._services = VehicleServices(
            self, self.flight, self.commands, self._mirror, self.latch_emergency
        )
        # Done once topics and services are announced, or have failed to be.
        self._announcing: Future[None] | None = None
        # Number of the link on which the vehicle was set up last.
        self._connection_count = 0
        self.status.publish()

    def connect(self) -> Future[None]:
        """Connect and announce all topics and services; the result is None.

        The future fails with `ServiceError` when that is not possible; then nothing
        remains of the vehicle.
        """
        return self.jobs.submit("connecting", self._connect)

    def latch_emergency(self) -> None:
        """Stop the motors at once, until the vehicle is removed; does not block.

        Raises `LinkLostError` if the vehicle is not heard; the stop is repeated until it arrives.
        """
        self.gate.handle(GateEvent.EMERGENCY_STOP)
        self.crazyflie.supervisor.emergency_stop()
        self.jobs.supersede("the emergency stop")
        self.status.publish()
        self.crazyflie.link()

    def remove(self, limit: float) -> Future[str]:
        """Land, stop the motors, end the link, take topics and services down; does not block.

        Also while the vehicle is being connected, or its jobs are blocked by it. The limit (s) is
        that of a landing: the vehicle lands without its link, too. The result says what could not
        be done, and is empty after a success.
        """
        self.transition(ConnectionEvent.REMOVAL)
        self.status.publish()
        self.gate.handle(GateEvent.REMOVAL)
        self.jobs.supersede("the removal")
        removal = Job(lambda _: self._remove(limit))
        return removal.start(self.handle.task, f"{self.parameters.name}-close")

    # Connecting and the end, in tasks.

    def _connect(self, _: Job) -> None:
        try:
            self.crazyflie.connect(self.server.connect_limit)
            self.transition(ConnectionEvent.LINK_OPENED)
            self._choose_positioning()
            self._services.wait_for_controllers()
            if self.is_closing():
                raise ServiceError("removed while connecting")
            self._announce()
        except Exception:
            self.transition(ConnectionEvent.REMOVAL)
            self._end()
            raise
        self.status.publish()
        self.info(f"connected to {self.parameters.uri}")

    def _announce(self):
        self._announcing = Future()
        try:
            self.log.start()
            self._set_up()
            self._services.advertise()
            self.setpoints.subscribe()
            self.commands.start()
            self.transition(ConnectionEvent.ANNOUNCED)
            # A new link may have come meanwhile.
            self._take_up_link()
        finally:
            self._announcing.set_result(None)

    def _choose_positioning(self):
        name = f"{self.parameters.prefix}/{POSITIONING_PARAMETER}"
        source = self.handle.get_param(name, Text(SOURCES), MOCAP)
        self.parameters = dataclasses.replace(self.parameters, positioning=source)

    def _set_up(self):
        # Once on each link.
        count = self.crazyflie.connection_count
        if self._connection_count == count:
            return
        lost = self._mirror.lost()
        if self.log.positioning is not None and self._mirror.begins_elsewhere(lost):
            self.log.positioning.suspend(_ELSEWHERE)
        if not self.gate.is_emergency:
            self._restore_parameters(lost)
            self._restore_groups()
            self.setpoints.open_thrust_lock(self.flight.read())
        # If it fails before, it is done when the vehicle is heard again.
        self._connection_count = count
        if self.parameters.enable_parameters:
            self._mirror.publish()

    def _restore_parameters(self, lost):
        if not lost:
            return
        state = self.flight.read()
        if state is None or SupervisorState.FLYING in state:
            names = ", ".join(lost)
            self.warn(f"not written again, as the vehicle may be flying: {names}; {_CALL_AGAIN}")
            return
        for problem in self._mirror.reapply(lost):
            self.warn(f"not written again: {problem}")

    def _restore_groups(self):
        # Also in flight, where it changes nothing.
        try:
            self.crazyflie.high_level.restore_group_mask()
        except LinkLostError:
            raise
        except CrazyflieError as error:
            self.warn(f"not set again: {error}; call set_group_mask again")

    def _on_estimate_reset(self):
        if self.log.positioning is not None:
            self.log.positioning.resume(self.handle.time() + _RESET_TIME)

    def _resume(self, _: Job) -> None:
        try:
            self._set_up()
        finally:
            self.transition(ConnectionEvent.RESUMED)

    def _remove(self, limit):
        problem = self._land_or_stop(limit)
        self._end()
        return problem

    def _end(self):
        # First the link: its end ends the wait for answers in `_connect`.
        self.crazyflie.close()
        if self._announcing is not None:
            self.handle.outside(wait, [self._announcing])
        self.handle.close()
        self.delivery.close()
        self.jobs.close()
        self.transition(ConnectionEvent.REMOVED)

    def _land_or_stop(self, limit):
        # Land a vehicle that flies and can land by itself, stop the motors of any other. The
        # firmware lands without a link, too; zero thrust would stop it in the air: so nothing is
        # sent to a vehicle of which neither supervisor nor log report whether it flies.
        problem = ""
        try:
            if self.gate.is_emergency:
                wait = self.crazyflie.supervisor.wait_for_emergency_stop
                if not wait(min(limit, _EMERGENCY_LIMIT)):
                    problem = "the emergency stop is not confirmed"
            elif self.crazyflie.connection_count:
                state = self.flight.read()
                if state is not None:
                    self._leave(state, limit)
                else:
                    # Raises if the link has been lost meanwhile.
                    self.crazyflie.link()
                    self.warn("it is not known whether the vehicle flies: it is left as it is")
        except (CrazyflieError, ServiceError, TimeoutError) as error:
            problem = f"its motors could not be stopped: {error}"
        if problem:
            self.warn(problem)
        return problem

    def _leave(self, state, limit):
        setpoints = self.setpoints
        is_flying = SupervisorState.FLYING in state
        on_setpoints = is_flying and setpoints.runs_motors and setpoints.can_land_autonomously()
        if self.flight.is_high_level(state) or on_setpoints:
            end = self.monotonic() + limit
            awaited(self.handle, self.commands.land(Reason.REMOVAL), REPLY_LIMIT + limit)
            if not self._has_landed(end):
                return
        elif is_flying and not setpoints.is_streaming:
            # It has landed less than 2 s ago, and is not locked by the silence; or another client
            # flies it.
            return
        # Otherwise the vehicle would be locked 2 s after the last setpoint.
        setpoints.send_zero_thrust()

    def _has_landed(self, end):
        self.sleep(min(_REACTION_TIME, max(0.0, end - self.monotonic())))
        while True:
            state = self.flight.read()
            # FLYING alone holds until 2 s after the motors have stopped.
            if state is not None and not self.flight.has_taken_off(state):
                return True
            if self.monotonic() > end:
                return False
            self.sleep(_LOOK_PERIOD)

    def _pass_link_state(self, state: LinkState, text: str) -> None:
        # From the link's threads.
        self._deliver_link_state(state.value, text)

    # In turn with the callbacks of the node.

    def _on_link_state(self, value: str, text: str) -> None:
        state, self.link_text = LinkState(value), text
        if state is LinkState.LOST:
            self.log.forget_state()
            self.gate.handle(GateEvent.LINK_LOST)
            self.transition(ConnectionEvent.LINK_LOST)
        elif state is LinkState.CONNECTED:
            self.gate.handle(GateEvent.LINK_BACK)
            self._take_up_link()
        if not self.is_closing():
            self._report(state, text)

    def _take_up_link(self):
        is_known = self.crazyflie.connection_count == self._connection_count
        event = ConnectionEvent.LINK_HEARD if is_known else ConnectionEvent.LINK_RENEWED
        if self.transition(event) is ConnectionState.RESUMING:
            self.jobs.submit("taking up the link again", self._resume)

    def _report(self, state, text):
        self.status.publish()
        if state is LinkState.LOST:
            self.error(f"{text}; trying to connect again")
        elif state is LinkState.CONNECTED and self.is_ready():
            self.warn(text)

    def _on_log(self):
        self.commands.follow()
        if self.log.is_flying and self.crazyflie.state is LinkState.CONNECTED:
            self.gate.handle(GateEvent.FLIGHT_REPORTED)
        self.setpoints.check_lift()
        self.status.publish()
