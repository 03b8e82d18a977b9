"""Common data of all parts of one vehicle, and the states of its connection."""

import enum
import threading
from dataclasses import dataclass, field

from crazyflie_driver.jobs import Delivery, Jobs
from crazyflie_driver.parameters import CrazyflieServerParameters, VehicleParameters
from crazyflie_driver.setpoint_gate import SetpointGate
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_utils import NodeHandle, ServiceError


class ConnectionState(enum.Enum):
    """State of a vehicle of the server, from adding to removing."""

    CONNECTING = enum.auto()  #: The first link is tried.
    SETTING_UP = enum.auto()  #: Log blocks are started, topics and services announced.
    READY = enum.auto()
    LOST = enum.auto()  #: There is no link, or it is silent.
    RESUMING = enum.auto()  #: On a new link the vehicle is set up again.
    CLOSING = enum.auto()  #: The vehicle is landed or stopped, and removed.
    CLOSED = enum.auto()


class ConnectionEvent(enum.Enum):
    """An event that changes a `ConnectionState`."""

    LINK_OPENED = enum.auto()  #: For the first time.
    ANNOUNCED = enum.auto()
    LINK_LOST = enum.auto()
    LINK_HEARD = enum.auto()  #: The link is the one from before the loss.
    LINK_RENEWED = enum.auto()
    RESUMED = enum.auto()
    REMOVAL = enum.auto()  #: It is to be removed, or could not be connected.
    REMOVED = enum.auto()


_STATE, _EVENT = ConnectionState, ConnectionEvent

#: (state, event) -> next state; an event without an entry changes nothing.
TRANSITIONS: dict[tuple[ConnectionState, ConnectionEvent], ConnectionState] = {
    (_STATE.CONNECTING, _EVENT.LINK_OPENED): _STATE.SETTING_UP,
    (_STATE.SETTING_UP, _EVENT.ANNOUNCED): _STATE.READY,
    (_STATE.READY, _EVENT.LINK_LOST): _STATE.LOST,
    # The link may have been lost while the vehicle was set up.
    (_STATE.READY, _EVENT.LINK_RENEWED): _STATE.RESUMING,
    (_STATE.LOST, _EVENT.LINK_HEARD): _STATE.READY,
    (_STATE.LOST, _EVENT.LINK_RENEWED): _STATE.RESUMING,
    (_STATE.RESUMING, _EVENT.LINK_LOST): _STATE.LOST,
    (_STATE.RESUMING, _EVENT.RESUMED): _STATE.READY,
    **{
        (state, _EVENT.REMOVAL): _STATE.CLOSING
        for state in _STATE
        if state not in (_STATE.CLOSING, _STATE.CLOSED)
    },
    (_STATE.CLOSING, _EVENT.REMOVED): _STATE.CLOSED,
}


@dataclass(eq=False)
class BaseVehicle:
    """Common data of all parts of one vehicle, which are attributes of `DriverVehicle`.

    The handle is closed when the vehicle is removed. Calls that block on the vehicle are jobs. All
    threads of the vehicle use its state; ``link_text`` says why the link is in its own.
    """

    handle: NodeHandle
    parameters: VehicleParameters
    server: CrazyflieServerParameters
    crazyflie: Crazyflie
    gate: SetpointGate
    jobs: Jobs
    delivery: Delivery
    link_text: str
    state: ConnectionState = ConnectionState.CONNECTING
    _state_lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def name(self) -> str:
        """Name of the vehicle in messages."""
        return self.parameters.name

    @property
    def prefix(self) -> str:
        """Absolute namespace of the vehicle, such as /crazyflie1; empty for the root."""
        return self.parameters.prefix

    def transition(self, event: ConnectionEvent) -> ConnectionState:
        """Change the state by an event, and return it."""
        with self._state_lock:
            self.state = TRANSITIONS.get((self.state, event), self.state)
            return self.state

    def is_ready(self) -> bool:
        """Return whether topics and services exist; also while the link is lost."""
        return self.state in (ConnectionState.READY, ConnectionState.LOST, ConnectionState.RESUMING)

    def is_closing(self) -> bool:
        """Return whether the vehicle is being removed, or has been."""
        return self.state in (ConnectionState.CLOSING, ConnectionState.CLOSED)

    def info(self, text: str) -> None:
        """Log information about the vehicle."""
        self.handle.info(f"{self.name}: {text}")

    def warn(self, text: str, throttle: float = 0.0, key: str = "") -> None:
        """Log a warning about the vehicle; see `NodeLog.warn`."""
        self.handle.warn(f"{self.name}: {text}", throttle, (self.name, key or text))

    def error(self, text: str) -> None:
        """Log an error of the vehicle."""
        self.handle.error(f"{self.name}: {text}")

    def refuse_after_emergency(self) -> None:
        """Raise `ServiceError` after an emergency stop, which holds until the removal."""
        if self.gate.is_emergency:
            raise ServiceError(
                f"emergency stop: remove {self.parameters.uri}, restart the vehicle and add it "
                "again"
            )
