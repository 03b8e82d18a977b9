"""Streamed setpoints: the vehicle follows the latest for a short while."""

import math
import struct
import threading
import time
from collections.abc import Sequence
from functools import partial

from cflib.crazyflie.commander import (
    SET_SETPOINT_CHANNEL,
    TYPE_HOVER_LEGACY,
    TYPE_VELOCITY_WORLD_LEGACY,
)
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.cflib_internals import packet
from crazyflie_link.errors import ValueRangeError
from crazyflie_link.subsystem import Subsystem, check_finite
from crazyflie_model.limits import FULL_PWM

ZEROS = 100  #: Setpoints of zero thrust after connecting and before leaving.

_ZERO_PERIOD, _SENT_LIMIT = 0.001, 1.0
_STREAM = "setpoint"
_MOST_MILLI = 32.767

_FOUR_FLOATS = struct.Struct("<Bffff")


class Setpoints(Subsystem):
    """Stream setpoints to a vehicle; nothing here blocks.

    All methods raise `LinkLostError` without a link, and `ValueRangeError` for
    numbers that cannot be sent.
    """

    def attitude(self, roll: float, pitch: float, yaw_rate: float, thrust: float) -> None:
        """Roll, pitch (degrees), yaw rate (degrees/s) and thrust (PWM, 0 to 65535).

        Positive pitch accelerates forward; over the link it is negated (by cflib).
        Positive yaw rate is clockwise seen from above, as on the link: the firmware negates it. The
        firmware ignores thrust until one setpoint of zero thrust has come.
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

        Positions, velocities and accelerations are in the world frame; the quaternion is (x, y, z,
        w). Over the link all are in thousandths, in 16 bits: at most
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
            raise ValueRangeError(
                "full-state setpoint: the quaternion (0, 0, 0, 0) is not an attitude"
            )
        self._stream(
            lambda c: c.send_full_state_setpoint(
                position, velocity, acceleration, quaternion, *rates
            )
        )

    def velocity_world(self, vx: float, vy: float, vz: float, yaw_rate: float) -> None:
        """Velocity in the world (m/s) and yaw rate (degrees/s, positive clockwise)."""
        check_finite("velocity setpoint", vx, vy, vz, yaw_rate)
        self._stream_legacy(TYPE_VELOCITY_WORLD_LEGACY, vx, vy, vz, yaw_rate)

    def hover(self, vx: float, vy: float, yaw_rate: float, height: float) -> None:
        """Velocity in the heading (m/s), yaw rate (degrees/s, positive clockwise), height (m)."""
        check_finite("hover setpoint", vx, vy, yaw_rate, height)
        self._stream_legacy(TYPE_HOVER_LEGACY, vx, vy, yaw_rate, height)

    def position(self, x: float, y: float, z: float, yaw: float) -> None:
        """Position in the world (m) and yaw (degrees)."""
        check_finite("position setpoint", x, y, z, yaw)
        self._stream(lambda c: c.send_position_setpoint(x, y, z, yaw))

    def stop(self) -> None:
        """Stop the motors."""
        self._stream(lambda c: c.send_stop_setpoint())

    def send_zero_thrust(self) -> None:
        """Send zero thrust `ZEROS` times, every millisecond; blocks until they are sent.

        It opens the firmware's thrust lock, and stops a vehicle that flies on setpoints. In the
        end "setpoints stop" is sent: otherwise the vehicle would be locked 2 s later.
        """
        link = self._current_link()
        link.discard(_STREAM)
        sent = threading.Event()
        for _ in range(ZEROS):
            link.put(lambda: link.cflib.commander.send_setpoint(0, 0, 0, 0))
            time.sleep(_ZERO_PERIOD)
        self.notify_setpoints_stop()
        link.put(sent.set)
        sent.wait(_SENT_LIMIT)

    def notify_setpoints_stop(self, remain_valid_ms: int = 0, at_once: bool = False) -> None:
        """Announce that no more setpoints follow; the last one remains valid for some ms.

        Without it the firmware ignores high-level commands after a streamed setpoint. ``at_once``
        sends in the calling thread, which must be the one that sends: see `Subsystem.guarded`.
        """
        if not 0 <= remain_valid_ms < 2**32:
            raise ValueRangeError(f"{remain_valid_ms} ms is not in 0 to 2^32 - 1")
        link = self._current_link()
        link.discard(_STREAM)
        notify = partial(link.cflib.commander.send_notify_setpoint_stop, remain_valid_ms)
        if at_once:
            notify()
        else:
            link.put(notify)

    def _stream(self, send):
        link = self._current_link()
        link.put_latest(_STREAM, lambda: send(link.cflib.commander))

    def _stream_legacy(self, kind, *values):
        # The types of crazyflie_cpp, which all firmware knows and whose yaw rate it negates. From
        # protocol 9 on cflib sends other types.
        link = self._current_link()

        def send():
            data = _FOUR_FLOATS.pack(kind, *values)
            link.cflib.send_packet(packet(CRTPPort.COMMANDER_GENERIC, SET_SETPOINT_CHANNEL, data))

        link.put_latest(_STREAM, send)
