"""The emergency stop, repeated on whatever link there is until the vehicle has obeyed."""

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from cflib.crazyflie.localization import Localization
from cflib.crazyflie.supervisor import (
    CMD_EMERGENCY_STOP,
    CMD_GET_STATE_BITFIELD,
    SUPERVISOR_CH_COMMAND,
    SUPERVISOR_CH_INFO,
)
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.errors import LinkLostError
from crazyflie_link.link import Link
from crazyflie_link.safe_crazyflie import packet
from crazyflie_model.supervisor import SupervisorState

#: The first protocol version in which the supervisor has a port of its own.
SUPERVISOR_PROTOCOL = 12
ANSWER = 0x80  #: Is added to the number of a command in the supervisor's answer.
PERIOD = 0.05  #: Between two repetitions, s.
#: How many repetitions are sent to a vehicle that is heard, but does not report its state.
BLIND_REPEATS = 5

_STREAM = "emergency"
_STOP_SETPOINT = packet(CRTPPort.COMMANDER_GENERIC, 0, b"\0")
_STOP = packet(CRTPPort.SUPERVISOR, SUPERVISOR_CH_COMMAND, bytes([CMD_EMERGENCY_STOP]))
_OLD_STOP = packet(
    CRTPPort.LOCALIZATION, Localization.GENERIC_CH, bytes([Localization.EMERGENCY_STOP])
)
_ASK_STATE = packet(CRTPPort.SUPERVISOR, SUPERVISOR_CH_INFO, bytes([CMD_GET_STATE_BITFIELD]))

#: Stops the motors of vehicles with any firmware.
BROADCAST_STOP = (_STOP, _OLD_STOP, _STOP_SETPOINT)


@dataclass(eq=False)
class EmergencyStop:
    """Stop the motors, on the present link and on every later one.

    It is sent until the supervisor says that it is locked; to firmware that cannot say so, a few
    times while the vehicle is heard.
    """

    # Returns the link on which something can be sent, also if it is silent or being opened.
    _any_link: Callable[[], Link | None]
    _closed: threading.Event = field(default_factory=threading.Event)
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _thread: threading.Thread | None = None
    _link: Link | None = None
    _heard: bool = False
    _repeats: int = 0
    _is_obeyed: bool = False

    @property
    def is_requested(self) -> bool:
        """Whether the vehicle is to be stopped."""
        return self._thread is not None

    def begin(self) -> None:
        """Send it before anything else that waits, and go on sending it; does not block."""
        with self._changed:
            self._begin_on(self._any_link())
            if self._link is not None:
                self._send(self._link, urgent=True)
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._run, name="crazyflie-emergency", daemon=True
                )
                self._thread.start()

    def receive(self, port: int, channel: int, data: bytes) -> None:
        """Take note of a packet from the vehicle."""
        self._heard = True
        if (port, channel) != (CRTPPort.SUPERVISOR, SUPERVISOR_CH_INFO) or len(data) < 3:
            return
        if self.is_requested and data[0] == ANSWER | CMD_GET_STATE_BITFIELD:
            state = SupervisorState(int.from_bytes(data[1:3], "little"))
            if SupervisorState.LOCKED in state:
                self._note_obeyed()

    def wait(self, limit: float) -> bool:
        """Wait until it was sent and, if the firmware reports that, obeyed; at most ``limit`` s."""
        with self._changed:
            return self._changed.wait_for(lambda: self._is_obeyed, limit)

    def close(self) -> None:
        """Do not send it any more."""
        self._closed.set()

    def _begin_on(self, link):
        self._link, self._repeats = link, 0
        self._heard = self._is_obeyed = False

    def _run(self):
        while not self._closed.wait(PERIOD):
            link = self._any_link()
            if link is not None:
                self._repeat(link)

    def _repeat(self, link):
        if link is not self._link:
            # The vehicle at its other end may have been restarted.
            self._begin_on(link)
        if self._is_obeyed:
            return
        if self._heard and 0 <= link.protocol < SUPERVISOR_PROTOCOL:
            self._repeats += 1
            if self._repeats > BLIND_REPEATS:
                self._note_obeyed()
                return
        self._heard = False
        self._send(link, urgent=False)

    def _note_obeyed(self):
        with self._changed:
            self._is_obeyed = True
            self._changed.notify_all()

    @staticmethod
    def _send(link: Link, urgent: bool) -> None:
        def send():
            for each in _packets(link.protocol):
                link.cflib.send_packet(each)

        with contextlib.suppress(LinkLostError):
            if urgent:
                link.put(send, urgent=True)
            else:
                # One that could not be sent yet is replaced.
                link.put_latest(_STREAM, send)


def _packets(protocol):
    packets = [_STOP_SETPOINT]
    if protocol < SUPERVISOR_PROTOCOL:
        packets.insert(0, _OLD_STOP)
    # A negative one is not known yet.
    if not 0 <= protocol < SUPERVISOR_PROTOCOL:
        packets.insert(0, _STOP)
        packets.append(_ASK_STATE)
    return packets
