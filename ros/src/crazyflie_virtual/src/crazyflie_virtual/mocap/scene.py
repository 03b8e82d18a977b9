"""What the cameras see of the virtual vehicles."""

import random
from dataclasses import dataclass

from crazyflie_model.angles import Quaternion, Triple
from crazyflie_simulator.motion_capture import MotionCapture
from crazyflie_virtual.mocap.natnet import BodyPose
from crazyflie_virtual.observer import Observation
from crazyflie_virtual.quaternions import turned

_STALE = 0.5
"""How long after the last observation a body counts as gone, s."""


@dataclass
class MocapSwitches:
    """What can be made to go wrong, at any time.

    Attributes
    ----------
    dropout : float
        Probability with which a body is not tracked in a frame.
    invalid : str
        Numbers of bodies that are not tracked, separated by commas; or "all".
    silent : bool
        Whether frames are held back.
    """

    dropout: float = 0.0
    invalid: str = ""
    silent: bool = False

    def hides(self, body_id: int) -> bool:
        """Return whether a body is one of those that are not tracked."""
        names = [part.strip() for part in self.invalid.split(",")]
        return "all" in names or str(body_id) in names


class Scene:
    """Rigid bodies, as observed last.

    Parameters
    ----------
    switches : MocapSwitches
    position_noise, attitude_noise : float
        Standard deviations along and about each axis, m and rad.
    seed : int
    """

    def __init__(
        self,
        switches: MocapSwitches,
        position_noise: float = 0.0,
        attitude_noise: float = 0.0,
        seed: int = 0,
    ):
        self._switches = switches
        self._noise = (position_noise, attitude_noise)
        self._seed = seed
        self._random = random.Random(seed)
        self._observations: dict[int, Observation] = {}
        self._cameras: dict[int, MotionCapture] = {}
        self._seen: dict[int, tuple[Triple, Quaternion]] = {}

    def observe(self, observation: Observation) -> None:
        """Take in an `Observation`."""
        body_id = observation.body_id
        if body_id not in self._cameras:
            self._cameras[body_id] = MotionCapture(*self._noise, seed=(self._seed, body_id))
        self._observations[body_id] = observation

    def bodies(self, time: float) -> list[BodyPose]:
        """Return every body as it is seen at ``time`` (s), in the order of their numbers.

        A body that is not tracked has the pose it was seen at last.
        """
        return [self._see(self._observations[i], time) for i in sorted(self._observations)]

    def _see(self, observation, time):
        body_id, name = observation.body_id, observation.name
        lost = (
            time - observation.time > _STALE
            or self._switches.hides(body_id)
            or self._random.random() < self._switches.dropout
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
