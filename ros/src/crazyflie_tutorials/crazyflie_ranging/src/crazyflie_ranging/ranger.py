"""What simulated range sensors measure."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.angles import Quaternion, Triple, rotate
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
        rays, origins, self._slices = [], [], []
        begin = 0
        for each in sensors:
            # Rotation works on the components of many vectors at once.
            rays.append(
                np.column_stack(rotate(each.attitude, cone(each.spread_angle, each.rays).T))
            )
            origins.append(np.tile(each.position, (each.rays, 1)))
            self._slices.append(slice(begin, begin + each.rays))
            begin += each.rays
        self._rays = np.concatenate(rays)
        self._origins = np.concatenate(origins)

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
        origins = np.column_stack(rotate(attitude, self._origins.T)) + position
        directions = np.column_stack(rotate(attitude, self._rays.T))
        distances, _ = world.cast(origins, directions)
        readings = []
        for sensor, own in zip(self._sensors, self._slices, strict=True):
            noise = sensor.noise * self._random.standard_normal()
            readings.append(sensor.reading(float(distances[own].min()) + noise))
        return readings
