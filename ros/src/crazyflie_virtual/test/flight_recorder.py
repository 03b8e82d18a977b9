"""Flights of a virtual vehicle, compared with recorded flights of the firmware.

These must be equal: the supervisor's states and their order, error numbers, answers. These may
differ:

* `MOMENT`: supervisor (40 ms), high-level commander (10 ms) and the log (20 ms) of
  the recorded vehicle run at phases of their own, and a command is on its way for
  some milliseconds. A height is compared with those of the `MOMENT` around it: it
  is the moment that differs where a vehicle falls with several m/s.
* `HEIGHT`: the recorded vehicle's body, of the software in the loop, has another
  ground, motor lag and battery than `crazyflie_model`.
* `SPEED`, `TURN`, `TILT`: so do drag and inertia.
* `PWM`: gyroscope noise is another; and `PEAK`: the log that was recorded has missed
  peaks that last one step.

The phase of the supervisor is chosen (`Flight.begin`) where the record shows a
state that another phase would skip. Where the steps do not say when a height was
measured, the times are those that make sense of the record.
"""

import math
import struct

import pytest
from cflib.crazyflie.mem import Poly4D
from virtual_bench import Bench, cflib_client, generic

from crazyflie_model.angles import zyx_from_quaternion
from crazyflie_virtual.body import STEP
from crazyflie_virtual.crtp import Port

MOMENT = 0.06  #: s.
HEIGHT = 0.05  #: m.
SPEED = 0.04  #: m/s.
TURN = 2.0  #: deg and deg/s.
TILT = 0.5  #: deg.
PWM, PEAK = 500.0, 3000.0  #: Of motor commands.
NEAR = 0.06  #: Of a position of a trajectory, m.
TURNED = 5.0  #: Of the heading in a trajectory, deg.

_SAMPLE = 0.01
_SUPERVISOR_PERIOD = 0.04


class Track:
    """Track of a vehicle, 100 times a second from a moment on."""

    def __init__(self, began):
        self.began = began
        self.rows = []

    def add(self, flight):
        time = flight.vehicle.time - self.began
        self.rows.append((time, f"{flight.bits:#x}", flight.motors_run, flight.physics.position))

    def height(self, time, expected):
        """Return the height nearest to what is expected, about a time."""
        return self.coordinate(time, expected, 2)

    def coordinate(self, time, expected, axis):
        """Return the coordinate nearest to what is expected, about a time."""
        near = [row[3][axis] for row in self.rows if abs(row[0] - time) < MOMENT]
        return min(near, key=lambda value: abs(value - expected))

    def check(self, recorded):
        """Compare bits and motors with those of a scenario."""
        self.check_bits(recorded["bits"])
        self.check_motors(recorded["motors_on_off"])

    def check_bits(self, recorded):
        """Compare with a record of bits: [time, bits] of each change."""
        self._check_changes(1, recorded)

    def check_motors(self, recorded):
        """Compare with a record of the motors: [time, whether any runs] of each change."""
        self._check_changes(2, recorded)

    def check_heights(self, recorded, times):
        """Compare with heights at times."""
        heights = [self.height(*pair) for pair in zip(times, recorded, strict=True)]
        assert heights == pytest.approx(recorded, abs=HEIGHT)

    def _check_changes(self, column, recorded):
        begin = recorded[0][0]
        changes = []
        for row in self.rows:
            if row[0] > begin - 0.5 * _SAMPLE and (not changes or row[column] != changes[-1][1]):
                changes.append((row[0], row[column]))
        assert [value for _, value in changes] == [value for _, value in recorded], changes
        # The first is what was there before.
        times = [time for time, _ in recorded]
        assert [time for time, _ in changes] == pytest.approx(times, abs=MOMENT), changes


class Flight(Bench):
    """A vehicle whose track is watched."""

    def __init__(self, **options):
        super().__init__(**options)
        self.begin()

    @property
    def bits(self):
        return int(self.firmware.info)

    @property
    def yaw(self):
        """Of the body, deg."""
        return math.degrees(zyx_from_quaternion(self.physics.quaternion)[2])

    @property
    def most(self):
        """Largest motor command, PWM."""
        return max(self.firmware.stabilizer.commands)

    def begin(self, before_supervisor=None):
        """Begin a new track; if asked for, when the supervisor's update is so far away, s."""
        if before_supervisor is not None:
            self.await_supervisor(before_supervisor)
        self.track = Track(self.vehicle.time)
        self.highest = 0.0
        self._sample()
        return self.track

    def await_supervisor(self, before):
        """Advance the time until the supervisor's next update is this far away, s."""
        period = round(_SUPERVISOR_PERIOD / STEP)
        while period - round(self.firmware.time / STEP) % period != round(before / STEP):
            self.run(STEP)

    def watch(self, duration, packet=None, period=0.02):
        """Advance the time, while a packet is sent repeatedly; return the track."""
        samples = round(duration / _SAMPLE)
        for i in range(samples):
            if packet is not None and i % round(period / _SAMPLE) == 0:
                assert self.ask(*packet) == []
            self.run(_SAMPLE)
            self._sample()
        return self.track

    def command(self, number, form, *values):
        """Give a command to the high-level commander; return the error number."""
        return self.ask_one(Port.HIGH_LEVEL, 0, struct.pack("<BB" + form, number, 0, *values))[3]

    def up(self, height, duration=2.0):
        """Take off by the high-level commander; return the error number."""
        return self.command(7, "ff?f", height, 0.0, False, duration)

    def land(self, duration=2.0):
        """Land by the high-level commander; return the error number."""
        return self.command(8, "ff?f", 0.0, 0.0, False, duration)

    def supervise(self, *data):
        """Give a command to the supervisor; return the answers as they are recorded."""
        return [answer.data.hex() for answer in self.ask(Port.SUPERVISOR, 1, bytes(data))]

    def _sample(self):
        self.track.add(self)
        self.highest = max(self.highest, self.most)


class CommandedFlight(Flight):
    """A flight that is commanded with cflib."""

    def fly(self, method, *arguments, **keywords):
        """Send what cflib's high-level commander sends; return the error number."""
        client, sent = cflib_client()
        getattr(client.high_level_commander, method)(*arguments, **keywords)
        (packet,) = sent
        return self.ask_one(packet.port, packet.channel, packet.data)[3]

    def climb(self, height):
        """Take off; the scenarios go on a second after the climb."""
        assert self.fly("takeoff", height, 2.0) == 0
        self.run(3.0)

    def upload(self, data, address=0):
        """Write into the trajectory memory."""
        for start in range(0, len(data), 24):
            request = struct.pack("<BI", 1, address + start) + data[start : start + 24]
            assert self.ask_one(Port.MEMORY, 2, request)[-1] == 0

    def pose(self):
        """Return x, y, z (m) and yaw (deg) of the estimate."""
        e = self.firmware.estimate
        return [e.x, e.y, e.z, e.yaw]

    def follow(self, track, origin=(0.0, 0.0, 0.0, 0.0), near=NEAR, slack=0.0):
        """Advance the time and compare with a recorded track: time, x, y, z, yaw from an origin.

        The times of the track are good to ``slack``, as a fraction: the nearest pose is compared.
        """
        begin = self.vehicle.time
        for time, *expected in track:
            self.run(begin + time * (1.0 - slack) - self.vehicle.time)
            poses = [self._pose_from(origin)]
            while self.vehicle.time < begin + time * (1.0 + slack):
                self.run(_SAMPLE)
                poses.append(self._pose_from(origin))
            pose = min(poses, key=lambda pose: math.dist(pose[:3], expected[:3]))
            assert pose[:3] == pytest.approx(expected[:3], abs=near), time
            assert math.remainder(pose[3] - expected[3], 360.0) == pytest.approx(0.0, abs=TURNED)

    def _pose_from(self, origin):
        dx, dy, dz, turn = (a - b for a, b in zip(self.pose(), origin, strict=True))
        c, s = math.cos(math.radians(origin[3])), math.sin(math.radians(origin[3]))
        return (c * dx + s * dy, c * dy - s * dx, dz, turn)


def circle(pieces=8, radius=0.5, period=4.0, height=0.6):
    """Return a circle to the left that begins at the origin along x, as polynomial pieces."""
    w = 2.0 * math.pi / period
    duration = period / pieces
    data = b""
    for k in range(pieces):
        phase = w * k * duration
        # Coefficients of exp(i (phase + w t)), by powers of t.
        terms = [w**n / math.factorial(n) for n in range(8)]
        sines = [a * math.sin(phase + n * math.pi / 2) for n, a in enumerate(terms)]
        cosines = [a * math.cos(phase + n * math.pi / 2) for n, a in enumerate(terms)]
        x = [radius * a for a in sines]
        y = [radius * ((n == 0) - a) for n, a in enumerate(cosines)]
        axes = (x, y, [height] + [0.0] * 7, [0.0] * 8)
        data += bytes(Poly4D(duration, *map(Poly4D.Poly, axes)).pack())
    return data


def position(x, y, z, yaw=0.0):
    """Return a position setpoint as it is on the wire."""
    return generic(7, "ffff", x, y, z, yaw)
