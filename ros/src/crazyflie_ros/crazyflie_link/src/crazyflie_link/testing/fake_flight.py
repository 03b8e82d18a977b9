"""High-level commander and supervisor of a vehicle without dynamics.

They answer and report as firmware 2026.08 was recorded to do (crazyflie_virtual,
test/recorded: takeoff_land, takeoff_twice_land_twice, hl_stop_in_flight, groups).
"""

import enum
import errno
import math
import struct
import time
from collections.abc import Callable

from crazyflie_model.supervisor import SupervisorState

REFUSED = 1  #: Reply to a takeoff while the planner flies, and to a landing while it lands.
FLYING_HOLDS = 2.0  #: How long FLYING is reported after the motors have stopped, s.
#: The first protocol whose supervisor has a port, and reports the high-level commander.
SUPERVISOR_PROTOCOL = 12

_SET_GROUPS, _STOP, _DEFINE, _TAKEOFF, _LAND, _GO_TO = 0, 3, 6, 7, 8, 12
_HIGH_LEVEL_BITS = (
    SupervisorState.HIGH_LEVEL_ACTIVE
    | SupervisorState.TRAJECTORY_FINISHED
    | SupervisorState.HIGH_LEVEL_DISABLED
)


class _Planner(enum.Enum):
    STOPPED = 0
    FLYING = 1
    LANDING = 2


class FakeFlight:
    """A planner and a supervisor, which follow commands, setpoints and a clock (s).

    The firmware's own watchdogs are left out: silence changes nothing. The protocol decides what is
    reported; ``starts`` is how many times the motors have begun to run.
    """

    def __init__(self, protocol: int = 12, clock: Callable[[], float] = time.monotonic):
        self._protocol = protocol
        self._clock = clock
        self.restart()

    def restart(self) -> None:
        """Begin anew, as after a restart of the vehicle: on the ground, armed."""
        self.starts = 0
        self._groups = 0
        self._is_locked = False
        self._pinned: SupervisorState | None = None
        self._planner = _Planner.STOPPED
        self._plan_end = -math.inf
        self._is_streamed = self._stream_runs = self._motors_ran = False
        self._stop_time = -math.inf

    def pin(self, state: SupervisorState | int | None) -> None:
        """Report a state whatever happens, with a planner that fits to it; None for no longer."""
        self._pinned = None if state is None else SupervisorState(state)
        if self._pinned is not None:
            is_active = SupervisorState.HIGH_LEVEL_ACTIVE in self._pinned
            self._planner = _Planner.FLYING if is_active else _Planner.STOPPED
            self._plan_end = math.inf

    @property
    def motors_run(self) -> bool:
        """Whether the motors run."""
        self._update()
        return self._motors_ran

    @property
    def is_landing(self) -> bool:
        """Whether the planner lands."""
        self._update()
        return self._planner is _Planner.LANDING

    @property
    def state(self) -> SupervisorState:
        """What the supervisor reports."""
        self._update()
        if self._pinned is not None:
            return self._pinned
        now = self._clock()
        can_fly = not self._is_locked
        state = SupervisorState.of(
            armed=can_fly,
            auto_armed=True,
            can_fly=can_fly,
            locked=self._is_locked,
            flying=can_fly and (self._motors_ran or now - self._stop_time < FLYING_HOLDS),
            high_level_active=self._planner is not _Planner.STOPPED,
            trajectory_finished=now >= self._plan_end,
        )
        return state if self._protocol >= SUPERVISOR_PROTOCOL else state & ~_HIGH_LEVEL_BITS

    def command(self, data: bytes) -> int:
        """Carry out the data of a packet to the high-level commander; return the error number."""
        number, group = data[0], data[1] if len(data) > 1 else 0
        if number == _SET_GROUPS:
            self._groups = group
            return 0
        if number == _DEFINE:
            return 0
        self._update()
        if self._is_locked and number != _STOP:
            return errno.EBUSY
        if group and not group & self._groups:
            return 0
        error = self._plan(number, data)
        self._update()
        return error

    def stream(self, runs: bool) -> None:
        """Take a setpoint, which stops the planner; with ``runs`` the motors run by it."""
        self._is_streamed, self._stream_runs = True, runs
        self._planner = _Planner.STOPPED
        self._update()

    def end_stream(self) -> None:
        """Give the motors to the planner, which holds them off without a command since."""
        self._is_streamed = False
        self._update()

    def lock(self) -> None:
        """Stop the motors and lock, until `restart`."""
        self._is_locked = True
        self._planner = _Planner.STOPPED
        self._update()

    def _plan(self, number, data):
        if number == _STOP:
            self._planner = _Planner.STOPPED
            return 0
        if number == _TAKEOFF and self._planner is not _Planner.STOPPED:
            return REFUSED
        if number == _LAND and self._planner is _Planner.LANDING:
            return REFUSED
        self._planner = _Planner.LANDING if number == _LAND else _Planner.FLYING
        # The last field of these is the duration.
        has_duration = number in (_TAKEOFF, _LAND, _GO_TO)
        duration = struct.unpack_from("<f", data, len(data) - 4)[0] if has_duration else 0.0
        self._plan_end = self._clock() + duration
        return 0

    def _update(self):
        now = self._clock()
        has_landed = self._planner is _Planner.LANDING and now >= self._plan_end
        if has_landed:
            self._planner = _Planner.STOPPED
        by_planner = self._planner is not _Planner.STOPPED
        run = not self._is_locked and (self._stream_runs if self._is_streamed else by_planner)
        if run and not self._motors_ran:
            self.starts += 1
        if self._motors_ran and not run:
            self._stop_time = self._plan_end if has_landed else now
        self._motors_ran = run
