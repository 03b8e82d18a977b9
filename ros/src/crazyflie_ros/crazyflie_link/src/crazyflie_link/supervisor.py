"""The vehicle's supervisor: arming, its state, emergency stop."""

from collections.abc import Callable

from cflib.crazyflie.supervisor import (
    CMD_ARM_SYSTEM,
    CMD_GET_STATE_BITFIELD,
    CMD_RECOVER_SYSTEM,
    SUPERVISOR_CH_COMMAND,
    SUPERVISOR_CH_INFO,
)
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.emergency import ANSWER, SUPERVISOR_PROTOCOL, EmergencyStop
from crazyflie_link.errors import RefusedError
from crazyflie_link.link import Link
from crazyflie_link.request_reply import Request
from crazyflie_link.subsystem import Subsystem
from crazyflie_model.supervisor import SupervisorState

_WATCHDOG = "watchdog"


class Supervisor(Subsystem):
    """The supervisor: the part of the firmware that arms and stops the motors.

    All that blocks raises `CrazyflieError` without a link or a reply.
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
        """Let a vehicle that has crashed be armed again; blocks until it has confirmed it."""
        link = self._current_link()
        if link.protocol < SUPERVISOR_PROTOCOL:
            link.put(link.cflib.supervisor.send_crash_recovery_request)
            return
        self._command(link, bytes([CMD_RECOVER_SYSTEM]), "recovering from a crash")

    def emergency_stop(self) -> None:
        """Stop the motors at once, before anything that is queued; does not block.

        Sent again and again until the vehicle is seen to be locked, also on a link that is silent
        or being opened, and on every later one. The vehicle has to be restarted before it can fly
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
            # Success, and the state of what was commanded: armed is not the answer to disarming.
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
