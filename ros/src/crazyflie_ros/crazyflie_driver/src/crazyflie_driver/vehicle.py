"""One vehicle of the server: its link, topics and services, from adding to removing."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from std_msgs.msg import String

from crazyflie_driver.battery import Battery
from crazyflie_driver.connected_topic import ConnectedTopic
from crazyflie_driver.connecting import connect_within
from crazyflie_driver.delivery import Delivery
from crazyflie_driver.farewell import take_leave
from crazyflie_driver.flight_commands import FlightCommands
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.parameter_mirror import ParameterMirror
from crazyflie_driver.server_parameters import CrazyflieServerParameters
from crazyflie_driver.services import VehicleServices
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.status import Status
from crazyflie_driver.vehicle_parameters import (
    CONNECTED_TOPIC,
    STATUS_TOPIC,
    VehicleParameters,
)
from crazyflie_driver.worker import Job, Worker
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import CrazyflieError, NoReplyError
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle, ServiceError

Result = TypeVar("Result")

_EMERGENCY_LIMIT = 1.0
"""How long a removal waits until the vehicle has obeyed an emergency stop, s."""

_LOGGED_STATE_LIMIT = 1.0
"""How long log data with the state are waited for, s; they come every 0.1 s."""


class DriverVehicle:
    """A vehicle that is being connected, is connected, or has lost its link.

    What takes time is done by the vehicle's own worker, so that no vehicle waits for
    another.

    Parameters
    ----------
    handle : NodeHandle
        Of the server.
    parameters : VehicleParameters
        How to connect it.
    server : CrazyflieServerParameters
        What all vehicles have in common.

    Attributes
    ----------
    crazyflie : crazyflie_link.Crazyflie
        The vehicle at the other end of the link.
    is_leaving : bool
        Whether the vehicle is being removed.
    is_emergency : bool
        Whether the emergency stop is latched.
    setpoints : SetpointTopics
    commands : FlightCommands

    Raises
    ------
    CrazyflieError
        The address is malformed.
    """

    def __init__(
        self,
        handle: NodeHandle,
        parameters: VehicleParameters,
        server: CrazyflieServerParameters,
    ):
        self.parameters = parameters
        self._handle = handle.child()
        self._server = handle
        self._safety = server
        self._link_text = f"connecting to {parameters.uri}"
        self.is_emergency = False
        self.is_leaving = False
        self.crazyflie = Crazyflie(
            parameters.uri,
            reconnect=True,
            on_state=self._on_link_state,
            on_console=lambda line: self._handle.info(f"{parameters.name}: {line}"),
            on_packet=self._on_packet,
        )
        self._links = 0
        self._worker = Worker(parameters.name)
        self._delivery = Delivery(self._handle, parameters.name)
        self._announcing = threading.Lock()
        self._battery = Battery(
            server.battery_low, server.battery_critical, server.battery_critical_time
        )
        self._log = LogTopics(
            self._handle,
            parameters,
            self.crazyflie,
            self._delivery,
            server.fixed_frame,
            self._on_status,
        )
        self.setpoints = SetpointTopics(self._handle, parameters, self.crazyflie, self._log)
        self.commands = FlightCommands(self._handle, self, self.setpoints, self._battery, server)
        self._mirror = ParameterMirror(self._handle, parameters.prefix, self.crazyflie)
        self._services = VehicleServices(self._handle, self)
        self._words = ""
        self._status = self._handle.publisher(
            f"{parameters.prefix}/{STATUS_TOPIC}", String, latch=True
        )
        self._connected = ConnectedTopic(self._handle, f"{parameters.prefix}/{CONNECTED_TOPIC}")
        self._publish_status()

    # LinkHealth.

    def connect(self) -> Future[None]:
        """Connect and announce all topics and services; the result is None.

        The future fails with `ServiceError` when that is not possible; then nothing
        remains of the vehicle.
        """
        return self.do("connecting", lambda _: self._connect())

    def leave(self, limit: float) -> Future[str]:
        """Land, stop the motors, end the link, take topics and services down.

        Also while the vehicle is being connected, or its worker waits for it.

        Parameters
        ----------
        limit : float
            How long a landing is waited for, s; the vehicle lands without its link, too.

        Returns
        -------
        Future of str
            What could not be done; empty if nothing.
        """
        self.is_leaving = True
        self._connected.update(False)
        self.setpoints.gate.leave()
        self._worker.overtake("the removal")
        done: Future[str] = Future()

        def work():
            try:
                done.set_result(self._leave(limit))
            except BaseException as error:
                done.set_exception(error)

        threading.Thread(target=work, name=f"{self.parameters.name}-leave", daemon=True).start()
        return done

    def do(
        self,
        what: str,
        work: Callable[[Job], Result],
        is_flight: bool = False,
        urgent: bool = False,
    ) -> Future[Result]:
        """Have ``work(job)`` done by the vehicle's worker; the result is its own.

        What goes wrong is logged, and fails the future with `ServiceError`.
        """

        def job(job):
            try:
                return work(job)
            except (CrazyflieError, ServiceError) as error:
                self._server.error(f"{self.parameters.name}: {what} failed: {error}")
                raise ServiceError(str(error)) from None

        if urgent:
            return self._worker.submit_urgent(what, job)
        return self._worker.submit(job, is_flight)

    def _connect(self):
        try:
            connect_within(
                self._safety.connect_limit, self.crazyflie.connect, lambda: self.is_leaving
            )
            self._services.names.wait_for_controllers(lambda: self.is_leaving)
            with self._announcing:
                if self.is_leaving:
                    raise ServiceError("removed while connecting")
                self._log.start()
                if self.parameters.enable_parameters:
                    self._mirror.publish()
                if not self.is_emergency:
                    self._open_thrust_lock()
                self._links = self.crazyflie.connection_count
                self._services.advertise()
                self.setpoints.subscribe()
                self.commands.start()
        except BaseException:
            self.is_leaving = True
            self._end()
            raise
        self._delivery.submit(self._publish_status)
        self._server.info(f"{self.parameters.name}: connected to {self.parameters.uri}")

    def _leave(self, limit):
        problem = ""
        try:
            if self.is_emergency:
                wait = self.crazyflie.supervisor.wait_for_emergency_stop
                if not wait(min(limit, _EMERGENCY_LIMIT)):
                    problem = "the emergency stop is not confirmed"
            elif self.crazyflie.connection_count and not take_leave(
                self, self._safety.landing_duration, limit
            ):
                # Unless it is the link that has been lost meanwhile.
                self.crazyflie.link()
                self._server.warn(
                    f"{self.parameters.name}: nothing tells whether the vehicle flies: it is left "
                    "as it is"
                )
        except CrazyflieError as error:
            problem = f"its motors could not be stopped: {error}"
        if problem:
            self._server.warn(f"{self.parameters.name}: {problem}")
        self._end()
        return problem

    def _end(self):
        # First the link: that ends the wait for answers in `_connect`.
        self.crazyflie.close()
        with self._announcing:
            self._handle.close()
        self._delivery.close()
        self._worker.close()

    def _open_thrust_lock(self):
        # Zero thrust would take a vehicle out of the air that flies by itself,
        # or that was flying when the link was lost.
        state = self.read_state()
        if state is None or SupervisorState.FLYING in state:
            self._server.warn(
                f"{self.parameters.name}: the vehicle may be flying: its thrust stays locked "
                "until a setpoint of zero thrust comes"
            )
        else:
            self.setpoints.send_zero_thrust()

    # What is asked of it.

    @property
    def supervisor(self) -> SupervisorState | None:
        """The state that was logged last; None if none was on the present link."""
        return self._log.supervisor

    @property
    def is_flying(self) -> bool:
        """Whether the vehicle says that it flies; so it does for 2 s after a landing."""
        state = self.supervisor
        return state is not None and SupervisorState.FLYING in state

    def read_state(self) -> SupervisorState | None:
        """Return the state, from supervisor or log; None if nothing tells it; blocks.

        Before protocol 12 the supervisor cannot be asked; very old firmware does not log it either.

        Raises
        ------
        LinkLostError
        """
        try:
            state = self.crazyflie.supervisor.read()
        except NoReplyError:
            state = None
        return self._log.next_state(_LOGGED_STATE_LIMIT) if state is None else state

    def now(self) -> float:
        """Return the time, s."""
        return self._handle.time()

    def stop_in_emergency(self) -> None:
        """Stop the motors at once and for good; does not block.

        Raises
        ------
        LinkLostError
            The vehicle is not heard; the stop is sent again and again, and arrives as soon as
            anything does.
        """
        self.is_emergency = True
        self.setpoints.gate.stop_for_good()
        self.crazyflie.supervisor.emergency_stop()
        self._worker.overtake("the emergency stop")
        self._publish_status()
        self.crazyflie.link()

    def write_parameters(self, names: list[str]) -> None:
        """Write ROS parameters GROUP/NAME to the firmware; blocks."""
        self._mirror.write(names)

    def refuse_in_emergency(self) -> None:
        """Raise `ServiceError` after an emergency stop."""
        if self.is_emergency:
            raise ServiceError(
                f"emergency stop: remove {self.parameters.uri}, restart the vehicle and add it "
                "again"
            )

    # What comes from the vehicle.

    def status(self, now: float) -> Status:
        """Return the vehicle's status at a moment (s)."""
        figures: dict[str, Any] = {}
        try:
            figures = {
                "quality": self.crazyflie.quality(),
                "is_poor": self.crazyflie.is_poor(),
                "latency": self.crazyflie.latency(),
                "age": self.crazyflie.age(),
            }
        except CrazyflieError:
            # Without a link there are none.
            pass
        return Status(
            self.crazyflie.state,
            self._link_text,
            self.is_emergency,
            battery=self._battery,
            rssi=self._log.rssi,
            supervisor=self._log.supervisor,
            setpoint_rate=self.setpoints.rate(now),
            ignored=self.setpoints.ignored,
            is_waiting=self.setpoints.gate.is_blocking(now),
            is_high_level=not self.setpoints.is_streaming,
            restarts=self.crazyflie.restarts,
            **figures,
        )

    def _on_status(self):
        voltage = self._log.voltage
        if voltage is not None:
            self._battery.update(voltage, self._handle.time())
            self.commands.check_battery()
        if self.is_flying and self.crazyflie.state is LinkState.CONNECTED:
            self.setpoints.gate.flight_goes_on()
        self.setpoints.check_lift()
        self._publish_status()

    def _publish_status(self):
        words = self.status(self._handle.time()).words()
        if words != self._words:
            self._words = words
            self._status.publish(String(words))
        is_linked = self.crazyflie.state is LinkState.CONNECTED and not self.is_leaving
        self._connected.update(is_linked and self._services.are_advertised)

    def _on_link_state(self, state, text):
        # From the link's own thread. At the end nothing may wait for the callbacks'
        # turn, since the node waits for the end.
        self._link_text = text
        if state is LinkState.LOST:
            self.setpoints.gate.link_lost()
            # What it was before the loss says nothing about now.
            self._log.supervisor = None
        elif state is LinkState.CONNECTED:
            self.setpoints.gate.link_back()
        if not self.is_leaving:
            self._delivery.submit(self._report_state, state, text)

    def _report_state(self, state, text):
        self._publish_status()
        if state is LinkState.LOST:
            self._handle.error(f"{self.parameters.name}: {text}; trying to connect again")
        elif state is LinkState.CONNECTED and self._services.are_advertised:
            self._handle.warn(f"{self.parameters.name}: {text}")
            self.do("taking up the link again", lambda _: self._resume())

    def _resume(self):
        # Without a set-up it is the link of before.
        if self.is_emergency or self._links == self.crazyflie.connection_count:
            return
        self._links = self.crazyflie.connection_count
        for problem in self._mirror.write_again():
            self._server.warn(f"{self.parameters.name}: not written again: {problem}")
        if self.parameters.enable_parameters:
            self._mirror.publish()
        self._open_thrust_lock()

    def _on_packet(self, port, channel, data):
        if not self.is_leaving:
            self._log.publish_packet(port, channel, data)
