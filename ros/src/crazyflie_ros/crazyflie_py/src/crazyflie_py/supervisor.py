"""The vehicle's supervisor: arming, its state, emergency stop."""

from collections.abc import Callable

from cflib.crtp.crtpstack import CRTPPort

from crazyflie_model.supervisor import SupervisorState
from crazyflie_py.errors import RefusedError
from crazyflie_py.exchange import Request
from crazyflie_py.link import Link
from crazyflie_py.subsystem import Subsystem

SUPERVISOR_PROTOCOL = 12
"""The first protocol version in which the supervisor has a port of its own."""

_EMERGENCY_REPEATS = 5
_INFO_CHANNEL, _COMMAND_CHANNEL = 0, 1
_GET_STATE, _ARM, _RECOVER = 0x0C, 0x01, 0x02
_ANSWER = 0x80
_WATCHDOG = "watchdog"


class Supervisor(Subsystem):
    """The supervisor: the part of the firmware that arms and stops the motors.

    Parameters
    ----------
    current_link : callable
        Returns the living `Link`, or raises `LinkLostError`.
    any_link : callable
        The same, but also one on which nothing comes at the moment.
    """

    def __init__(self, current_link: Callable[[], Link], any_link: Callable[[], Link]):
        super().__init__(current_link)
        self._any_link = any_link

    def read(self) -> SupervisorState | None:
        """Ask for the state; blocks. None when the firmware is too old to report it.

        Raises
        ------
        CrazyflieError
            No link or no reply.
        """
        link = self._current_link()
        if link.protocol < SUPERVISOR_PROTOCOL:
            return None
        answer = self._ask(link, _INFO_CHANNEL, bytes([_GET_STATE]), "the supervisor's state")
        return SupervisorState(int.from_bytes(answer[1:3], "little"))

    def arm(self, do_arm: bool = True) -> None:
        """Arm or disarm the motors; blocks until the vehicle has confirmed it.

        Firmware before protocol 12 confirms nothing.

        Raises
        ------
        RefusedError
            The vehicle cannot be armed now; the text says why.
        CrazyflieError
            No link or no reply.
        """
        link = self._current_link()
        if link.protocol < SUPERVISOR_PROTOCOL:
            link.command(lambda: link.cflib.supervisor.send_arming_request(do_arm))
            return
        verb = "arming" if do_arm else "disarming"
        self._command(link, bytes([_ARM, do_arm]), verb)

    def recover(self) -> None:
        """Let a vehicle that has crashed be armed again; blocks until it has confirmed it.

        Raises
        ------
        CrazyflieError
            As `arm`.
        """
        link = self._current_link()
        if link.protocol < SUPERVISOR_PROTOCOL:
            link.command(link.cflib.supervisor.send_crash_recovery_request)
            return
        self._command(link, bytes([_RECOVER]), "recovering from a crash")

    def emergency_stop(self) -> None:
        """Stop the motors at once, before anything else that waits to be sent; does not block.

        Sent several times, since a packet may be lost, and also when nothing has come from the
        vehicle of late. The vehicle has to be restarted before it can fly again.

        Raises
        ------
        LinkLostError
            Nothing can be sent.
        """
        link = self._any_link()

        def send():
            link.cflib.supervisor.send_emergency_stop()
            link.cflib.commander.send_stop_setpoint()

        for _ in range(_EMERGENCY_REPEATS):
            link.command(send, urgent=True)

    def feed_watchdog(self) -> None:
        """Feed the emergency-stop watchdog; does not block.

        It begins with the first feed and cannot be ended: 1 s after the last one the vehicle
        stops its motors and is locked until it is restarted, also on the ground.

        Raises
        ------
        LinkLostError
            Nothing can be sent.
        """
        link = self._current_link()
        link.stream(_WATCHDOG, link.cflib.supervisor.send_emergency_stop_watchdog)

    def _command(self, link: Link, data: bytes, what: str) -> None:
        answer = self._ask(link, _COMMAND_CHANNEL, data, what)
        if len(answer) > 1 and not answer[1]:
            state = self.read()
            words = "unknown" if state is None else state.words()
            raise RefusedError(f"{what}: the vehicle refuses it; its state is: {words}")

    @staticmethod
    def _ask(link: Link, channel: int, data: bytes, what: str) -> bytes:
        prefix = bytes([_ANSWER | data[0]])
        return link.ask(data, Request(CRTPPort.SUPERVISOR, channel, prefix, what))
