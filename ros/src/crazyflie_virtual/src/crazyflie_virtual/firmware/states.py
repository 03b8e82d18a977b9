"""What the parts of the firmware hand to each other, in the firmware's units and signs.

Angles are in degrees, rates in degrees per second, accelerations in g. The
pitch of attitudes and of setpoints is the firmware's: positive is nose up, so
that a *negative* pitch accelerates forward (+x). Quaternions and positions are
those of the rest of the workspace.
"""

from dataclasses import dataclass, replace

from crazyflie_virtual.firmware.compressed import compress_quaternion

DISABLED, ABSOLUTE, VELOCITY = 0, 1, 2
"""Modes of a setpoint's axis: not controlled, to this value, at this rate."""


@dataclass(slots=True)
class Setpoint:
    """What the vehicle is to do. With all axes disabled and no thrust: nothing, motors off.

    Attributes
    ----------
    mode_x, mode_y, mode_z, mode_roll, mode_pitch, mode_yaw, mode_quaternion : int
        `DISABLED`, `ABSOLUTE` or `VELOCITY`.
    x, y, z : float
        m, fixed frame.
    vx, vy, vz : float
        m/s, fixed frame or, with ``velocity_body``, turned by the heading.
    ax, ay, az : float
        m/s^2, fixed frame.
    roll, pitch, yaw : float
        deg.
    roll_rate, pitch_rate, yaw_rate : float
        deg/s, positive yaw rate is counter-clockwise.
    quaternion : tuple
        (x, y, z, w).
    thrust : float
        PWM, used where z is disabled.
    time : float
        When it was given, s.
    """

    mode_x: int = DISABLED
    mode_y: int = DISABLED
    mode_z: int = DISABLED
    mode_roll: int = DISABLED
    mode_pitch: int = DISABLED
    mode_yaw: int = DISABLED
    mode_quaternion: int = DISABLED
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    velocity_body: bool = False
    ax: float = 0.0
    ay: float = 0.0
    az: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    roll_rate: float = 0.0
    pitch_rate: float = 0.0
    yaw_rate: float = 0.0
    quaternion: tuple = (0.0, 0.0, 0.0, 1.0)
    thrust: float = 0.0
    time: float = 0.0

    @property
    def modes(self) -> tuple:
        """All modes: controllers begin anew when they change."""
        return (
            self.mode_x,
            self.mode_y,
            self.mode_z,
            self.mode_roll,
            self.mode_pitch,
            self.mode_yaw,
            self.mode_quaternion,
        )

    def leveled(self) -> "Setpoint":
        """Return the setpoint made level, with the heading kept; height stays as it is."""
        return replace(
            self,
            mode_x=DISABLED,
            mode_y=DISABLED,
            mode_roll=ABSOLUTE,
            mode_pitch=ABSOLUTE,
            mode_yaw=VELOCITY,
            roll=0.0,
            pitch=0.0,
            yaw_rate=0.0,
        )


@dataclass(slots=True)
class Estimate:
    """What the vehicle takes its state to be.

    Attributes
    ----------
    x, y, z, vx, vy, vz : float
        m and m/s, fixed frame.
    ax, ay, az : float
        g, fixed frame, without gravity.
    roll, pitch, yaw : float
        deg, ``R = Rz(yaw) Ry(-pitch) Rx(roll)``.
    qx, qy, qz, qw : float
        Body to fixed frame.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    ax: float = 0.0
    ay: float = 0.0
    az: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0

    @property
    def quaternion(self) -> tuple:
        """(qx, qy, qz, qw)."""
        return (self.qx, self.qy, self.qz, self.qw)

    @property
    def compressed_quaternion(self) -> int:
        """The quaternion in 32 bits."""
        return compress_quaternion(self.quaternion)
