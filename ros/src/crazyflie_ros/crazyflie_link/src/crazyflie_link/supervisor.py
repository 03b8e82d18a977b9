"""The vehicle's supervisor: arming, its state, and the emergency stop."""

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from cflib.crazyflie.localization import Localization
from cflib.crazyflie.supervisor import (
    CMD_ARM_SYSTEM,
    CMD_EMERGENCY_STOP,
    CMD_GET_STATE_BITFIELD,
    CMD_RECOVER_SYSTEM,
    SUPERVISOR_CH_COMMAND,
    SUPERVISOR_CH_INFO,
)
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.cflib_internals import packet
from crazyflie_link.errors import LinkLostError, RefusedError
from crazyflie_link.link import Link
from crazyflie_link.subsystem import Subsystem
from crazyflie_link.transmission import Request
from crazyflie_model.supervisor import SupervisorState

#: First version of the protocol in which the supervisor has a port of its own.
SUPERVISOR_PROTOCOL = 12
ANSWER = 0x80  #: Offset of the number of a command in the supervisor's answer.
PERIOD = 0.05  #: Time between two repetitions (s).
#: Number of repetitions to a vehicle that is heard, but does not report its state.
BLIND_REPEATS = 5

_STREAM = "emergency"
_STOP_SETPOINT = packet(CRTPPort.COMMANDER_GENERIC, 0, b"\0")
_STOP = packet(CRTPPort.SUPERVISOR, SUPERVISOR_CH_COMMAND, bytes([CMD_EMERGENCY_STOP]))
_OLD_STOP = packet(
    CRTPPort.LOCALIZATION, Localization.GENERIC_CH, bytes([Localization.EMERGENCY_STOP])
)
_ASK_STATE = packet(CRTPPort.SUPERVISOR, SUPERVISOR_CH_INFO, bytes([CMD_GET_STATE_BITFIELD]))

#: Packet that stops the motors of vehicles with any firmware.
BROADCAST_STOP = (_STOP, _OLD_STOP, _STOP_SETPOINT)


@dataclass(eq=False)
class EmergencyStop:
    """Stop the motors, on the present link and on every later one.

    It is sent until the supervisor says that it is locked; with firmware that cannot report it, a
    few times while the vehicle is heard.
    """

    # Returns the link on which something can be sent, also if it is silent or being opened.
    _any_link: Callable[[], Link | None]
    _closed: threading.Event = field(default_factory=threading.Event)
    _obeyed: threading.Event = field(default_factory=threading.Event)
    _beginning: threading.Lock = field(default_factory=threading.Lock)
    _thread: threading.Thread | None = None
    _link: Link | None = None
    _heard: bool = False
    _repeats: int = 0

    @property
    def is_requested(self) -> bool:
        """Whether the vehicle is to be stopped."""
        return self._thread is not None

    def begin(self) -> None:
        """Send the stop before all queued packets, then repeat it; does not block."""
        with self._beginning:
            self._begin_on(self._any_link())
            if self._link is not None:
                self._send(self._link, urgent=True)
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._run, name="crazyflie-emergency", daemon=True
                )
                self._thread.start()

    def receive(self, port: int, channel: int, data: bytes) -> None:
        """Check a packet for the vehicle's report that it is locked."""
        self._heard = True
        if (port, channel) != (CRTPPort.SUPERVISOR, SUPERVISOR_CH_INFO) or len(data) < 3:
            return
        if self.is_requested and data[0] == ANSWER | CMD_GET_STATE_BITFIELD:
            state = SupervisorState(int.from_bytes(data[1:3], "little"))
            if SupervisorState.LOCKED in state:
                self._obeyed.set()

    def wait(self, limit: float) -> bool:
        """Wait until it was sent and, if the firmware reports that, obeyed; at most ``limit`` s."""
        return self._obeyed.wait(limit)

    def close(self) -> None:
        """Stop sending."""
        self._closed.set()

    def _begin_on(self, link):
        self._link, self._repeats = link, 0
        self._heard = False
        self._obeyed.clear()

    def _run(self):
        while not self._closed.wait(PERIOD):
            link = self._any_link()
            if link is not None:
                self._repeat(link)

    def _repeat(self, link):
        if link is not self._link:
            # The vehicle at its other end may have been restarted.
            self._begin_on(link)
        if self._obeyed.is_set():
            return
        if self._heard and 0 <= link.protocol < SUPERVISOR_PROTOCOL:
            self._repeats += 1
            if self._repeats > BLIND_REPEATS:
                self._obeyed.set()
                return
        self._heard = False
        self._send(link, urgent=False)

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


_WATCHDOG = "watchdog"


class Supervisor(Subsystem):
    """The supervisor: the part of the firmware that arms and stops the motors.

    Blocking methods raise `CrazyflieError` without a link or a reply.
    """

    def __init__(self, current_link: Callable[[], Link], emergency: EmergencyStop):
        super().__init__(current_link)
        self._emergency = emergency

    def read(self) -> SupervisorState | None:
        """Ask for the state; blocks. None when the firmware is too old to report it."""
        return read_state(self._current_link())

    def arm(self, do_arm: bool = True) -> None:
        """Arm or disarm the motors; blocks until the vehicle has confirmed it.

        Firmware before protocol 12 confirms nothing. A vehicle that cannot be armed now refuses it,
        and the error says why.
        """
        link = self._current_link()
        if link.protocol < SUPERVISOR_PROTOCOL:
            link.put(lambda: link.cflib.supervisor.send_arming_request(do_arm))
            return
        verb = "arming" if do_arm else "disarming"
        self._command(link, bytes([CMD_ARM_SYSTEM, do_arm]), verb)

    def recover(self) -> None:
        """Clear a crash, so that the vehicle can be armed; blocks until it has confirmed it."""
        link = self._current_link()
        if link.protocol < SUPERVISOR_PROTOCOL:
            link.put(link.cflib.supervisor.send_crash_recovery_request)
            return
        self._command(link, bytes([CMD_RECOVER_SYSTEM]), "recovering from a crash")

    def emergency_stop(self) -> None:
        """Stop the motors at once, before anything that is queued; does not block.

        The stop is repeated until the vehicle is seen to be locked, also on a link that is silent
        or being opened, and on every later one. The vehicle must be restarted before it can fly
        again.
        """
        self._emergency.begin()

    def wait_for_emergency_stop(self, limit: float) -> bool:
        """Return whether the vehicle has obeyed an emergency stop within a limit (s); blocks.

        Firmware before protocol 12 does not report it: there it means that the stop has been sent
        several times while the vehicle was heard.
        """
        return self._emergency.wait(limit)

    def feed_watchdog(self) -> None:
        """Feed the emergency-stop watchdog; does not block.

        It cannot be ended: 1 s after the last feed the vehicle stops its motors and is locked until
        it is restarted, also on the ground.
        """
        link = self._current_link()
        link.put_latest(_WATCHDOG, link.cflib.supervisor.send_emergency_stop_watchdog)

    def _command(self, link: Link, data: bytes, what: str) -> None:
        def accepts(answer: bytes) -> bool:
            # Success requires the commanded state: "armed" is not the answer to disarming.
            return len(answer) < 3 or len(data) < 2 or not answer[1] or answer[2] == data[1]

        prefix = bytes([ANSWER | data[0]])
        request = Request(CRTPPort.SUPERVISOR, SUPERVISOR_CH_COMMAND, prefix, what, accepts=accepts)
        answer = link.request(data, request)
        if len(answer) > 1 and not answer[1]:
            state = self.read()
            words = "unknown" if state is None else state.words()
            raise RefusedError(f"{what}: the vehicle refuses it; its state is: {words}")


def read_state(link: Link) -> SupervisorState | None:
    """Return the state that is reported over a link; see `Supervisor.read`."""
    if link.protocol < SUPERVISOR_PROTOCOL:
        return None
    prefix = bytes([ANSWER | CMD_GET_STATE_BITFIELD])
    request = Request(CRTPPort.SUPERVISOR, SUPERVISOR_CH_INFO, prefix, "the supervisor's state")
    answer = link.request(bytes([CMD_GET_STATE_BITFIELD]), request)
    return SupervisorState(int.from_bytes(answer[1:3], "little"))
