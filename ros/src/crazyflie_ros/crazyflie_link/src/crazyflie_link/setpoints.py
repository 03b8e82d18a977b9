"""Setpoints that are streamed: the vehicle follows the latest for a short while.

Units and signs are those of this module's methods; what goes over the link is in
their descriptions, since that is what counts.
"""

import math
import struct
import threading
import time
from collections.abc import Sequence

from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.backend import packet
from crazyflie_link.checks import check_finite
from crazyflie_link.errors import ValueRangeError
from crazyflie_link.subsystem import Subsystem
from crazyflie_model.limits import FULL_PWM

ZEROS = 100
"""Setpoints of zero thrust after connecting and before leaving."""

_SENT_LIMIT = 1.0
_STREAM = "setpoint"
_MOST_MILLI = 32.767

_VELOCITY_WORLD, _HOVER = 1, 5
"""Types of generic setpoints whose yaw rate the firmware negates. They are what
crazyflie_cpp sends, and all firmware knows them; 8 and 10, which cflib sends from protocol
9 on, are the same without the negation."""

_FOUR_FLOATS = struct.Struct("<Bffff")


class Setpoints(Subsystem):
    """Stream setpoints to a vehicle; nothing here blocks.

    All methods raise `LinkLostError` without a link, and `ValueRangeError` for
    numbers that cannot be sent.
    """

    def attitude(self, roll: float, pitch: float, yaw_rate: float, thrust: int) -> None:
        """Roll, pitch (degrees), yaw rate (degrees/s) and thrust (PWM, 0 to 65535).

        Positive pitch accelerates forward; over the link it is negated (by cflib).
        Positive yaw rate is clockwise seen from above, as the link has it: the
        firmware negates it. The firmware ignores thrust until one setpoint
        of zero thrust has come.
        """
        check_finite("attitude setpoint", roll, pitch, yaw_rate, thrust)
        if not 0 <= thrust <= FULL_PWM:
            raise ValueRangeError(f"thrust is {thrust}; expected 0 to {FULL_PWM:g} PWM")
        self._stream(lambda c: c.send_setpoint(roll, pitch, yaw_rate, int(thrust)))

    def full_state(
        self,
        position: Sequence[float],
        velocity: Sequence[float],
        acceleration: Sequence[float],
        quaternion: Sequence[float],
        rates: Sequence[float],
    ) -> None:
        """Position (m), velocity (m/s), acceleration (m/s^2), attitude and body rates (rad/s).

        Positions, velocities and accelerations are of the world; the quaternion is
        (x, y, z, w). Over the link all are in thousandths, in 16 bits: at most
        +-32.767. Rates are in milliradians/s there.
        """
        thousandths = (*position, *velocity, *acceleration, *rates)
        check_finite("full-state setpoint", *thousandths, *quaternion)
        for value in thousandths:
            if abs(value) > _MOST_MILLI:
                raise ValueRangeError(
                    f"full-state setpoint: {value:g} is outside +-{_MOST_MILLI} (m, m/s, m/s^2, "
                    "rad/s)"
                )
        if math.hypot(*quaternion) < 1e-6:
            raise ValueRangeError("full-state setpoint: the quaternion (0, 0, 0, 0) is no attitude")
        self._stream(
            lambda c: c.send_full_state_setpoint(
                position, velocity, acceleration, quaternion, *rates
            )
        )

    def velocity_world(self, vx: float, vy: float, vz: float, yaw_rate: float) -> None:
        """Velocity in the world (m/s) and yaw rate (degrees/s, positive clockwise)."""
        check_finite("velocity setpoint", vx, vy, vz, yaw_rate)
        self._stream_generic(_VELOCITY_WORLD, vx, vy, vz, yaw_rate)

    def hover(self, vx: float, vy: float, yaw_rate: float, height: float) -> None:
        """Velocity in the heading (m/s), yaw rate (degrees/s, positive clockwise), height (m)."""
        check_finite("hover setpoint", vx, vy, yaw_rate, height)
        self._stream_generic(_HOVER, vx, vy, yaw_rate, height)

    def position(self, x: float, y: float, z: float, yaw: float) -> None:
        """Position in the world (m) and yaw (degrees)."""
        check_finite("position setpoint", x, y, z, yaw)
        self._stream(lambda c: c.send_position_setpoint(x, y, z, yaw))

    def stop(self) -> None:
        """Stop the motors."""
        self._stream(lambda c: c.send_stop_setpoint())

    def zeros(self, count: int = ZEROS, period: float = 0.001) -> None:
        """Send zero thrust ``count`` times, every ``period`` seconds; blocks until they are sent.

        It opens the firmware's thrust lock, and stops a vehicle that flies on setpoints. In the
        end they are handed over (`hand_over`): otherwise the vehicle would be locked 2 s later.
        """
        link = self._current_link()
        link.forget(_STREAM)
        sent = threading.Event()
        for _ in range(count):
            link.command(lambda: link.cflib.commander.send_setpoint(0, 0, 0, 0))
            time.sleep(period)
        self.hand_over()
        link.command(sent.set)
        sent.wait(_SENT_LIMIT)

    def hand_over(self, remain_valid_ms: int = 0) -> None:
        """Announce that no more setpoints follow: high-level commands are accepted again.

        Without it the firmware ignores them after a streamed setpoint.

        Parameters
        ----------
        remain_valid_ms : int
            How long the last setpoint still counts, ms.
        """
        if not 0 <= remain_valid_ms < 2**32:
            raise ValueRangeError(f"{remain_valid_ms} ms is not in 0 to 2^32 - 1")
        link = self._current_link()
        link.forget(_STREAM)
        link.command(lambda: link.cflib.commander.send_notify_setpoint_stop(remain_valid_ms))

    def hand_over_now(self, remain_valid_ms: int = 0) -> None:
        """Do the same at once: for the thread that sends, right before a command.

        See `Subsystem.guarded`, whose ``may_send`` may do that.
        """
        link = self._current_link()
        link.forget(_STREAM)
        link.cflib.commander.send_notify_setpoint_stop(remain_valid_ms)

    def _stream(self, send):
        link = self._current_link()
        link.stream(_STREAM, lambda: send(link.cflib.commander))

    def _stream_generic(self, kind, *values):
        link = self._current_link()

        def send():
            data = _FOUR_FLOATS.pack(kind, *values)
            link.cflib.send_packet(packet(CRTPPort.COMMANDER_GENERIC, 0, data))

        link.stream(_STREAM, send)
