"""What the cameras see of the virtual vehicles."""

import random
from dataclasses import dataclass

from crazyflie_model.angles import Quaternion, Triple
from crazyflie_simulator.motion_capture import MotionCapture
from crazyflie_virtual.mocap.natnet import BodyPose
from crazyflie_virtual.observer import Observation
from crazyflie_virtual.quaternions import turned

OCCLUSION = 0.3  #: Longest time for which a vehicle is hidden, s.
_GHOST_MARGIN = 0.3  #: How far from the vehicles reflections may be, m.
_STALE = 0.5  #: How long after the last observation a body counts as gone, s.


@dataclass
class MocapSwitches:
    """What can be made to go wrong, at any time."""

    dropout: float = 0.0  #: Probability with which a body is not tracked in a frame.
    invalid: str = ""  #: Numbers of bodies that are not tracked, separated by commas; or "all".
    silent: bool = False  #: Whether frames are held back.
    #: Mean number of markers in a frame that are none: reflections, anywhere between the vehicles.
    ghosts: float = 0.0
    #: How often a vehicle begins to be hidden, 1/s; each time for up to `OCCLUSION` s.
    occlusions: float = 0.0

    def hides(self, body_id: int) -> bool:
        """Return whether a body is one of those that are not tracked."""
        return is_listed(body_id, self.invalid)


def is_listed(body_id: int, text: str) -> bool:
    """Return whether a body is named by a text: numbers with commas, or "all"."""
    names = [part.strip() for part in text.split(",")]
    return "all" in names or str(body_id) in names


class Scene:
    """Rigid bodies, as observed last.

    The noise is in standard deviations along and about each axis, m and rad. ``single_markers`` are
    numbers of the vehicles with one marker, separated by commas, or "all": they are no rigid
    bodies. ``rate`` is in frames per second.
    """

    def __init__(
        self,
        switches: MocapSwitches,
        position_noise: float = 0.0,
        attitude_noise: float = 0.0,
        seed: int = 0,
        single_markers: str = "",
        rate: float = 120.0,
    ):
        self._switches = switches
        self._noise = (position_noise, attitude_noise)
        self._seed = seed
        self._random = random.Random(seed)
        self._observations: dict[int, Observation] = {}
        self._cameras: dict[int, MotionCapture] = {}
        self._seen: dict[int, tuple[Triple, Quaternion]] = {}
        self._single_markers = single_markers
        self._hidden_until: dict[int, float] = {}
        self._frame_period = 1.0 / rate

    def observe(self, observation: Observation) -> None:
        """Take in an `Observation`."""
        body_id = observation.body_id
        if body_id not in self._cameras:
            self._cameras[body_id] = MotionCapture(*self._noise, seed=(self._seed, body_id))
        self._observations[body_id] = observation

    def bodies(self, time: float) -> list[BodyPose]:
        """Return every rigid body as it is seen at ``time`` (s), in the order of their numbers.

        A body that is not tracked has the pose it was seen at last.
        """
        return [
            self._see(self._observations[number], time)
            for number in sorted(self._observations)
            if not is_listed(number, self._single_markers)
        ]

    def markers(self, time: float) -> list[Triple]:
        """Return the markers of vehicles that have one, and reflections, in any order, m.

        A marker that is not seen is not there.
        """
        found = [
            self._see(self._observations[number], time)
            for number in sorted(self._observations)
            if is_listed(number, self._single_markers)
        ]
        points = [body.position for body in found if body.is_tracked]
        if found and self._switches.ghosts:
            ranges = [
                (min(axis) - _GHOST_MARGIN, max(axis) + _GHOST_MARGIN)
                for axis in zip(*(body.position for body in found), strict=True)
            ]
            ghosts = int(self._switches.ghosts + self._random.random())
            points += [
                tuple(self._random.uniform(*limits) for limits in ranges) for _ in range(ghosts)
            ]
        self._random.shuffle(points)
        return points

    def _is_hidden(self, body_id, time):
        rate = self._switches.occlusions
        if time < self._hidden_until.get(body_id, 0.0):
            return True
        if not rate or self._random.random() >= rate * self._frame_period:
            return False
        self._hidden_until[body_id] = time + self._random.uniform(0.0, OCCLUSION)
        return True

    def _see(self, observation, time):
        body_id, name = observation.body_id, observation.name
        lost = (
            time - observation.time > _STALE
            or self._switches.hides(body_id)
            or self._random.random() < self._switches.dropout
            or self._is_hidden(body_id, time)
        )
        if not lost:
            camera = self._cameras[body_id]
            camera.measure(time, *_extrapolate(observation, time))
            _, position, quaternion = camera.arrivals(time)[-1]
            self._seen[body_id] = (position, quaternion)
        never = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        position, quaternion = self._seen.get(body_id, never)
        return BodyPose(body_id, name, position, quaternion, not lost)


def _extrapolate(observation, time):
    # Observations come with a few milliseconds between them and not in step
    # with the frames; over these the vehicle goes straight on.
    dt = time - observation.time
    position = tuple(
        p + v * dt for p, v in zip(observation.position, observation.velocity, strict=True)
    )
    half_angles = (0.5 * dt * rate for rate in observation.rates)
    return position, turned(observation.quaternion, *half_angles)
