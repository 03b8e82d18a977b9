"""One vehicle of the server: its link, topics and services, from adding to removing."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.parameter_mirror import ParameterMirror
from crazyflie_driver.services import VehicleServices
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.status import NOT_FLYABLE, Status
from crazyflie_driver.vehicle_parameters import VehicleParameters
from crazyflie_driver.worker import Worker
from crazyflie_model.supervisor import SupervisorState
from crazyflie_py.crazyflie import Crazyflie, LinkState
from crazyflie_py.errors import CrazyflieError, NoAnswerError
from crazyflie_py.high_level import HighLevel
from crazyflie_utils import NodeHandle, ServiceError

Result = TypeVar("Result")

CONNECT_LIMIT = 3.0
"""How long it is tried to connect to a vehicle that does not answer, s: one that is
switched on or launched together with the driver needs a while."""

CONNECT_PAUSE = 0.2
"""Between two attempts, s."""


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
    fixed_frame : str
        Frame of the pose.

    Attributes
    ----------
    crazyflie : crazyflie_py.Crazyflie
        The vehicle at the other end of the link.
    is_leaving : bool
        Whether the vehicle is being removed.

    Raises
    ------
    CrazyflieError
        The address is malformed.
    """

    def __init__(self, handle: NodeHandle, parameters: VehicleParameters, fixed_frame: str):
        self.parameters = parameters
        self._handle = handle.child()
        self._server = handle
        self._link_text = f"connecting to {parameters.uri}"
        self._is_emergency = False
        self.is_leaving = False
        self.crazyflie = Crazyflie(
            parameters.uri,
            reconnect=True,
            on_state=self._on_link_state,
            on_console=lambda line: self._handle.info(f"{parameters.name}: {line}"),
            on_packet=self._on_packet,
        )
        self._worker = Worker(parameters.name)
        self._announcing = threading.Lock()
        self._log = LogTopics(self._handle, parameters, self.crazyflie, fixed_frame)
        self._setpoints = SetpointTopics(self._handle, parameters, self.crazyflie, self._log)
        self._mirror = ParameterMirror(self._handle, parameters.prefix, self.crazyflie)
        self._services = VehicleServices(self._handle, self)

    # Life.

    def connect(self) -> Future[None]:
        """Connect and announce all topics and services; the result is None.

        The future fails with `ServiceError` when that is not possible; then nothing
        remains of the vehicle.
        """
        return self.do("connecting", self._connect)

    def leave(self) -> Future[None]:
        """Stop the motors, end the link, take topics and services down; the result is None.

        Also while the vehicle is being connected, or its worker waits for it.
        """
        self.is_leaving = True
        self._setpoints.is_blocked = True
        worker = Worker(f"{self.parameters.name}-leave")
        done = worker.submit(self._leave)
        worker.close()
        return done

    def do(self, what: str, work: Callable[[], Result]) -> Future[Result]:
        """Have ``work()`` done by the vehicle's worker; the result is its own.

        What goes wrong is logged, and fails the future with `ServiceError`.
        """

        def job():
            try:
                return work()
            except (CrazyflieError, ServiceError) as error:
                self._server.error(f"{self.parameters.name}: {what} failed: {error}")
                raise ServiceError(str(error)) from None

        return self._worker.submit(job)

    def _connect(self):
        try:
            self._connect_link()
            self._services.names.wait_for_controllers(lambda: self.is_leaving)
            with self._announcing:
                if self.is_leaving:
                    raise ServiceError("removed while connecting")
                self._log.start()
                if self.parameters.enable_parameters:
                    self._mirror.publish()
                self._open_thrust_lock(is_new=True)
                self._services.advertise()
                self._setpoints.subscribe()
        except BaseException:
            self.is_leaving = True
            self._end()
            raise
        self._server.info(f"{self.parameters.name}: connected to {self.parameters.uri}")

    def _connect_link(self):
        end = time.monotonic() + CONNECT_LIMIT
        while True:
            try:
                return self.crazyflie.connect()
            except NoAnswerError:
                if self.is_leaving or time.monotonic() > end:
                    raise
            time.sleep(CONNECT_PAUSE)

    def _leave(self):
        try:
            if self.crazyflie.state is LinkState.CONNECTED:
                self._setpoints.zeros()
        except CrazyflieError as error:
            self._server.warn(f"{self.parameters.name}: cannot stop the motors: {error}")
        self._end()

    def _end(self):
        # First the link: that ends the wait for answers in `_connect`.
        self.crazyflie.close()
        with self._announcing:
            self._handle.close()
        self._worker.close()

    def _open_thrust_lock(self, is_new):
        # Zero thrust would take a vehicle out of the air that flies by itself,
        # or that was flying when the link was lost.
        state = self.crazyflie.supervisor.read()
        is_flying = not is_new if state is None else SupervisorState.FLYING in state
        if is_flying:
            self._server.warn(
                f"{self.parameters.name}: the vehicle may be flying: its thrust stays locked "
                "until a setpoint of zero thrust comes"
            )
        else:
            self._setpoints.zeros()

    # Commands.

    @property
    def is_emergency(self) -> bool:
        """Whether the emergency stop is latched."""
        return self._is_emergency

    def stop_in_emergency(self) -> None:
        """Stop the motors at once and for good; does not block.

        Raises
        ------
        LinkLostError
            Nothing can be sent now; it will be when the link is back.
        """
        self._is_emergency = True
        self._setpoints.is_blocked = True
        self.crazyflie.supervisor.emergency_stop()

    def hand_over(self, remain_valid_ms: int = 0) -> None:
        """Announce to the vehicle that setpoints end; does not block."""
        self._setpoints.hand_over(remain_valid_ms)

    def command(
        self, what: str, send: Callable[[HighLevel], Result], duration: float = 0.0
    ) -> Future[Result]:
        """Have a high-level command sent, after a hand-over if setpoints were streamed.

        Parameters
        ----------
        what : str
        send : callable
            ``send(high_level)`` blocks; the future's result is its own.
        duration : float
            How long the vehicle will be at it, s.
        """

        def work():
            self.refuse_in_emergency()
            if self._setpoints.is_streaming:
                self._setpoints.hand_over()
            response = send(self.crazyflie.high_level)
            self._setpoints.high_level_until(self._handle.time() + duration)
            return response

        return self.do(what, work)

    def make_ready(self) -> None:
        """See to it that the vehicle can take off: arm it, if it is not armed; blocks.

        Raises
        ------
        ServiceError
            It cannot fly.
        CrazyflieError
            It refuses, or does not reply.
        """
        state = self.crazyflie.supervisor.read()
        if state is None:
            return
        if state & NOT_FLYABLE:
            raise ServiceError(f"the vehicle cannot fly, its state is: {state.words()}")
        if SupervisorState.ARMED not in state:
            self.crazyflie.supervisor.arm()

    def write_parameters(self, names: list[str]) -> None:
        """Write ROS parameters GROUP/NAME to the firmware; blocks."""
        self._mirror.write(names)

    def refuse_in_emergency(self) -> None:
        """Raise `ServiceError` after an emergency stop."""
        if self._is_emergency:
            raise ServiceError(
                f"emergency stop: remove {self.parameters.uri}, restart the vehicle and add it "
                "again"
            )

    # What comes from the vehicle.

    def status(self, now: float) -> Status:
        """Return the vehicle's status at a moment (s)."""
        figures = {}
        try:
            figures = {
                "quality": self.crazyflie.quality(),
                "latency": self.crazyflie.latency(),
                "age": self.crazyflie.age(),
            }
        except CrazyflieError:
            # Without a link there are none.
            pass
        return Status(
            self.crazyflie.state,
            self._link_text,
            self._is_emergency,
            voltage=self._log.voltage,
            rssi=self._log.rssi,
            supervisor=self._log.supervisor,
            setpoint_rate=self._setpoints.rate(now),
            ignored=self._setpoints.ignored,
            **figures,
        )

    def _on_link_state(self, state, text):
        # From the link's own thread. At the end nothing may wait for the callbacks'
        # turn, since the node waits for the end.
        self._link_text = text
        if not self.is_leaving:
            self._handle.submit(self._report_state, state, text)

    def _report_state(self, state, text):
        if state is LinkState.LOST:
            self._handle.error(f"{self.parameters.name}: {text}; trying to connect again")
        elif state is LinkState.CONNECTED and self._services.are_advertised:
            self._handle.warn(f"{self.parameters.name}: {text}")
            self.do("taking up the link again", self._resume)

    def _resume(self):
        if self._is_emergency:
            self.crazyflie.supervisor.emergency_stop()
            return
        if self.parameters.enable_parameters:
            self._mirror.publish()
        self._open_thrust_lock(is_new=False)

    def _on_packet(self, port, channel, data):
        if not self.is_leaving:
            self._log.publish_packet(port, channel, data)
