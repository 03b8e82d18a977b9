"""What simulated range sensors measure."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from crazyflie_model.angles import Quaternion, Triple
from crazyflie_ranging.range_sensors import RangeSensor
from crazyflie_world.world import World

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


def cone(spread: float, count: int) -> NDArray[np.float64]:
    """Return directions that fill a cone about the x axis evenly, the first along its axis.

    They are on a spiral, each turned from the last by the golden angle (Vogel, A better way to
    construct the sunflower head, 1979).

    Parameters
    ----------
    spread : float
        From edge to edge, rad.
    count : int

    Returns
    -------
    ndarray, shape (count, 3)
        Of length 1.
    """
    k = np.arange(count)
    off = spread / 2.0 * np.sqrt(k / max(count - 1, 1))
    around = _GOLDEN_ANGLE * k
    return np.column_stack(
        [np.cos(off), np.sin(off) * np.cos(around), np.sin(off) * np.sin(around)]
    )


class Ranger:
    """Sensors on a vehicle that measure at the same time.

    Parameters
    ----------
    sensors : sequence of RangeSensor
    random : numpy.random.Generator
        Of the noise.
    """

    def __init__(self, sensors: Sequence[RangeSensor], random: np.random.Generator):
        self._sensors = sensors
        self._random = random
        rays: list[NDArray[np.float64]] = []
        self._slices: list[slice] = []
        begin = 0
        for each in sensors:
            turn = Rotation.from_quat(each.attitude)
            rays.append(turn.apply(cone(each.spread_angle, each.rays)))
            self._slices.append(slice(begin, begin + each.rays))
            begin += each.rays
        self._origins = np.repeat(
            [each.position for each in sensors], [each.rays for each in sensors], axis=0
        )
        self._rays = np.concatenate(rays)

    def measure(self, world: World, position: Triple, attitude: Quaternion) -> list[float]:
        """Return what each sensor says, m: the nearest of what is in its cone.

        Parameters
        ----------
        world : World
        position : tuple of float
            Of the vehicle in the world's frame, m.
        attitude : tuple of float
            From the body's to the world's frame, (x, y, z, w), of norm 1.
        """
        turn = Rotation.from_quat(attitude)
        distances, _ = world.cast(position + turn.apply(self._origins), turn.apply(self._rays))
        readings = []
        for sensor, own in zip(self._sensors, self._slices, strict=True):
            noise = sensor.noise * self._random.standard_normal()
            readings.append(sensor.reading(float(distances[own].min()) + noise))
        return readings
