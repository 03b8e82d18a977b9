"""Blocks of a stream of setpoints: of a new vehicle, after a lost link, and others."""

import enum
import math

from crazyflie_model.limits import OFF_AGE

#: Length of a pause (s) after which a stream was restarted on purpose.
STREAM_PAUSE = 1.0

#: Time after a high-level command or cmd_stop in which setpoints are not sent, s. Each topic has a
#: connection of its own, so that some are under way then: a single one would take the vehicle from
#: its planner or start its motors, and lock it 2 s later.
OVERLAP = 0.5


class SetpointKind(enum.Enum):
    """Kind of a setpoint, or of what has replaced setpoints."""

    HIGH_LEVEL = enum.auto()  #: Or the notice that setpoints stop.
    ENDED = enum.auto()  #: The same notice, after zero thrust.
    ZERO_THRUST = enum.auto()
    THRUST = enum.auto()
    REFERENCE = enum.auto()


class Block(enum.Flag):
    """Reasons for which setpoints are not sent; several can hold, and the first one is named."""

    EMERGENCY = enum.auto()
    REMOVAL = enum.auto()
    BATTERY = enum.auto()
    LINK_LOST = enum.auto()
    OLD_STREAM = enum.auto()
    NEW = enum.auto()
    UNCONFIRMED = enum.auto()
    LANDED = enum.auto()
    NOT_LIFTED = enum.auto()


class GateEvent(enum.Enum):
    """An event that changes the blocks."""

    EMERGENCY_STOP = enum.auto()
    REMOVAL = enum.auto()
    BATTERY_CRITICAL = enum.auto()
    BATTERY_RECOVERED = enum.auto()
    LINK_LOST = enum.auto()
    LINK_BACK = enum.auto()
    FLIGHT_REPORTED = enum.auto()
    FLIGHT_CALLED = enum.auto()
    DISARMED = enum.auto()
    NOT_LIFTED = enum.auto()
    STREAM_BEGUN = enum.auto()
    GROUND_COMMANDED = enum.auto()


_NONE = Block(0)
_ADDED = Block.OLD_STREAM | Block.NEW
_ON_TRIAL = Block.UNCONFIRMED | Block.LANDED | Block.NOT_LIFTED
_CALLED = Block.OLD_STREAM | Block.UNCONFIRMED

#: Event, blocks of which one must hold (none: in any case), blocks that begin, blocks that end.
#: Each row of an event is used, in this order.
TRANSITIONS = (
    (GateEvent.EMERGENCY_STOP, _NONE, Block.EMERGENCY, _NONE),
    (GateEvent.REMOVAL, _NONE, Block.REMOVAL, _NONE),
    # The vehicle lands.
    (GateEvent.BATTERY_CRITICAL, _NONE, Block.BATTERY, _NONE),
    # On the ground, where the voltage recovers: the old stream must not start another flight.
    (GateEvent.BATTERY_RECOVERED, Block.BATTERY, Block.LANDED, Block.BATTERY),
    (GateEvent.LINK_LOST, _NONE, Block.LINK_LOST, Block.UNCONFIRMED),
    # The vehicle may have been restarted, or its battery been changed, and be in a hand.
    (GateEvent.LINK_BACK, Block.LINK_LOST, Block.UNCONFIRMED, Block.LINK_LOST),
    # The vehicle reports a flight, as it does with thrust on the ground, too.
    (GateEvent.FLIGHT_REPORTED, _NONE, _NONE, Block.UNCONFIRMED),
    # A service call makes the vehicle fly, later, or only arms it: that does not end a stream from
    # before, and until the vehicle reports a flight, thrust begins at zero.
    (GateEvent.FLIGHT_CALLED, _ON_TRIAL | Block.NEW, _CALLED, Block.NEW | _ON_TRIAL),
    # Most vehicles arm themselves again within 0.2 s.
    (GateEvent.DISARMED, _NONE, _ADDED, _NONE),
    # Setpoints have commanded a flight, and the vehicle has not lifted off.
    (GateEvent.NOT_LIFTED, _NONE, Block.NOT_LIFTED, _NONE),
    # After a pause, or with zero thrust.
    (GateEvent.STREAM_BEGUN, _NONE, _NONE, Block.LANDED | Block.NOT_LIFTED | Block.OLD_STREAM),
    # By zero thrust, or a reference that is on the ground, or follows a pause.
    (GateEvent.GROUND_COMMANDED, _NONE, _NONE, _ADDED | Block.UNCONFIRMED),
)

_ADVICE = f"pause the stream for {STREAM_PAUSE:g} s, or send zero thrust"

#: Block -> words of the warning; the first that holds is named.
REASONS = {
    Block.EMERGENCY: "emergency stop",
    Block.REMOVAL: "the vehicle is being removed",
    Block.BATTERY: "the battery is critical",
    Block.LINK_LOST: "the link is lost",
    Block.OLD_STREAM: (
        f"it comes since before the vehicle was added, disarmed or called to fly: {_ADVICE}"
    ),
    Block.NEW: "the vehicle has just been added, or disarmed: begin with zero thrust",
    Block.UNCONFIRMED: (
        "the link was lost, or the vehicle called to fly, and it has not reported a flight since: "
        "begin with zero thrust"
    ),
    Block.LANDED: f"the vehicle was landed for its battery: {_ADVICE}",
    Block.NOT_LIFTED: f"the vehicle was commanded to fly and did not lift off: {_ADVICE}",
}


class SetpointGate:
    """Decide about each setpoint; times are s of one clock.

    The gate of a new vehicle is closed: what comes may be a stream from before, for a vehicle that
    flew then, and thrust that begins above zero makes a vehicle leap. So is that of one that was
    disarmed, or whose link was lost, until it reports a flight. A call opens it for setpoints that
    take over a vehicle that flies.

    Everything is in turn with callbacks, but for a look at `is_emergency`.
    """

    def __init__(self) -> None:
        self._blocks = _ADDED
        self._commands = 0
        # When setpoints could come first, when the latest one came, and of which kind it was.
        self._begin, self._latest = math.inf, -math.inf
        self._control = SetpointKind.ZERO_THRUST
        self._high_level_since: float | None = None
        self._stopped_since: float | None = None

    @property
    def is_emergency(self) -> bool:
        """Whether there was an emergency stop."""
        return Block.EMERGENCY in self._blocks

    def handle(self, event: GateEvent) -> None:
        """Change the blocks as an event does."""
        for each, needed, begun, ended in TRANSITIONS:
            if each is event and (not needed or needed & self._blocks):
                self._blocks = self._blocks & ~ended | begun

    def listen(self, now: float) -> None:
        """Record that setpoints are subscribed to."""
        self._begin = now

    def high_level(self, now: float) -> int:
        """Begin the overlap of a high-level command; return the number of the command."""
        self._high_level_since = now
        self._commands += 1
        return self._commands

    def resume(self, command: int) -> None:
        """Allow setpoints again after a command (its number) failed, unless one has followed."""
        if command == self._commands:
            self._high_level_since = None

    def stop(self, now: float) -> None:
        """Begin the overlap of cmd_stop, which ends a stream."""
        self._stopped_since = now

    def refusal_of_repetition(self, now: float) -> str:
        """Return the `refusal` of a setpoint of the driver's own: it is not part of a stream."""
        return self._reason(now, False)

    def is_blocking(self, now: float) -> bool:
        """Return whether a stream from before a loss of the link, or an adding, is blocked."""
        is_streamed = now - self._latest <= STREAM_PAUSE
        return is_streamed and bool(self._blocks & (_ADDED | Block.UNCONFIRMED))

    def arming_refusal(self, now: float) -> str:
        """Return why arming would start the motors; empty if it would not.

        The firmware obeys the latest setpoint for `OFF_AGE`. One that was blocked counts, too.
        """
        if self._control is SetpointKind.ZERO_THRUST or now - self._latest > OFF_AGE:
            return ""
        return (
            "setpoints come that would start its motors at once: end them (call /land if a "
            f"takeoff server sends them), and arm it after zero thrust, or {OFF_AGE:g} s later"
        )

    def refusal(self, now: float, control: SetpointKind) -> str:
        """Return why a setpoint must not be sent; empty if it may."""
        is_zero = control is SetpointKind.ZERO_THRUST
        has_paused = now - max(self._begin, self._latest) > STREAM_PAUSE
        self._latest, self._control = now, control
        # References do not make a vehicle leap.
        if is_zero or (has_paused and control is SetpointKind.REFERENCE):
            self.handle(GateEvent.GROUND_COMMANDED)
        if (is_zero or has_paused) and not self._blocks & ~(_ON_TRIAL | _ADDED):
            self.handle(GateEvent.STREAM_BEGUN)
        return self._reason(now, is_zero)

    def _reason(self, now, is_zero):
        for block, reason in REASONS.items():
            if block in self._blocks:
                return reason
        for since, event in (
            (self._high_level_since, "given a high-level command"),
            (self._stopped_since, "stopped by cmd_stop"),
        ):
            if since is not None and now - since < OVERLAP and not is_zero:
                return f"the vehicle was just {event}"
        return ""
