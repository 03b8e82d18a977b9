"""Range sensors on a vehicle: their YAML file, and the measurements of simulated ones."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from typing_extensions import override

from crazyflie_model.angles import Quaternion, Triple, quaternion_from_rpy
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.declaration import Complaints
from crazyflie_utils.parameters.types import FRAME, POSITION, TOPIC, Integer, Number, Text, path_of
from crazyflie_utils.text import shown
from crazyflie_world.world import World

LASER, ULTRASONIC = "laser", "ultrasonic"  #: Types of sensors.

#: Directions of sensors: roll, pitch, yaw that turn the body's x axis to them (rad).
DIRECTIONS: dict[str, Triple] = {
    "front": (0.0, 0.0, 0.0),
    "back": (0.0, 0.0, math.pi),
    "left": (0.0, 0.0, math.pi / 2.0),
    "right": (0.0, 0.0, -math.pi / 2.0),
    "up": (0.0, -math.pi / 2.0, 0.0),
    "down": (0.0, math.pi / 2.0, 0.0),
}


class RangeSensor(Parameters):
    """A sensor that measures the distance to the nearest object in a cone, as in a sensor file."""

    type: str = parameter(Text((LASER, ULTRASONIC)), "kind of radiation")
    name: str = parameter(TOPIC, "its topic")
    frame_id: str = parameter(FRAME, "tf frame of the sensor; the x axis is the axis of the cone")
    direction: str = parameter(Text(tuple(DIRECTIONS)), "direction of the sensor")
    position: Triple = parameter(POSITION, "position in the body's frame", (0.0, 0.0, 0.0))
    min_range: float = parameter(Number("m", minimum=0.0), "shortest distance that is measured")
    max_range: float = parameter(Number("m", above=0.0), "longest distance that is measured")
    spread_angle: float = parameter(
        Number("rad", minimum=0.0, maximum=math.pi), "angle of the cone, from edge to edge"
    )
    desired_frequency: float = parameter(
        Number("Hz", above=0.0, maximum=100.0), "rate of measurements"
    )
    noise: float = parameter(
        Number("m", minimum=0.0), "standard deviation of the noise, if simulated", 0.0
    )
    rays: int = parameter(Integer(1, 1000), "number of rays in the cone, if simulated", 13)
    variable: str | None = parameter(
        Text(), "log variable of the firmware, mm; without it range.NAME", None
    )

    @override
    def complaints(self) -> Iterator[str]:
        if self.min_range >= self.max_range:
            yield (f"min_range is {self.min_range:g}; expected < max_range, {self.max_range:g} (m)")

    @property
    def log_variable(self) -> str:
        """Log variable of the firmware with the distance (mm)."""
        return self.variable or f"range.{self.name}"

    @property
    def attitude(self) -> Quaternion:
        """Rotation of its frame in the body's."""
        return quaternion_from_rpy(*DIRECTIONS[self.direction])

    def reading(self, distance: float) -> float:
        """Return the sensor's reading at a distance (m).

        It is infinity beyond the sensor's range and negative infinity below it, as in REP 117.
        """
        if distance > self.max_range:
            return math.inf
        return distance if distance >= self.min_range else -math.inf


def load(path: str | Path) -> tuple[RangeSensor, ...]:
    """Return the sensors in a file, which has a list ``sensors``.

    `ParameterError` names all errors: file, line and what was expected.
    """
    file = yaml_file.load(path)
    sensors: list[RangeSensor] = []
    complaints = Complaints()
    lines: dict[str, dict[str, int]] = {"name": {}, "frame_id": {}}
    for key, entry in file.entries().items():
        if key != "sensors" and not entry.is_template:
            complaints += entry.error("is not known; expected sensors").complaints
    for entry in file["sensors"].elements():
        with complaints:
            sensors.append(entry.read(RangeSensor))
            for key, taken in lines.items():
                value = entry[key]
                if value.value in taken:
                    text = f"is {shown(value.value)}, which is there in line {taken[value.value]}"
                    raise value.error(text)
                taken[value.value] = value.line
    if not sensors and not complaints:
        complaints += file["sensors"].error("is empty; expected at least one sensor").complaints
    complaints.raise_any()
    return tuple(sensors)


SENSOR_FILE = path_of(load, "a sensor file")


_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


def cone(spread: float, count: int) -> NDArray[np.float64]:
    """Return unit vectors, shape (count, 3), that fill a cone about the x axis evenly.

    The first is along the axis. They are on a spiral, each turned from the last by the golden angle
    (Vogel, A better way to construct the sunflower head, 1979); ``spread`` is from edge to edge,
    rad.
    """
    k = np.arange(count)
    off = spread / 2.0 * np.sqrt(k / max(count - 1, 1))
    around = _GOLDEN_ANGLE * k
    return np.column_stack(
        [np.cos(off), np.sin(off) * np.cos(around), np.sin(off) * np.sin(around)]
    )


class Ranger:
    """Sensors on a vehicle that measure at the same time; ``random`` draws their noise."""

    def __init__(self, sensors: Sequence[RangeSensor], random: np.random.Generator):
        self._sensors = sensors
        self._random = random
        counts = [each.rays for each in sensors]
        self._ends = np.cumsum(counts)[:-1]
        self._origins = np.repeat([each.position for each in sensors], counts, axis=0)
        rays = [Rotation.from_quat(s.attitude).apply(cone(s.spread_angle, s.rays)) for s in sensors]
        self._rays = np.concatenate(rays)

    def measure(self, world: World, position: Triple, attitude: Quaternion) -> list[float]:
        """Return the reading of each sensor, m: the distance to the nearest object in its cone.

        Position (m) and attitude (a quaternion of norm 1) are those of the vehicle in the world's
        frame.
        """
        turn = Rotation.from_quat(attitude)
        distances, _ = world.cast(position + turn.apply(self._origins), turn.apply(self._rays))
        readings = []
        for sensor, own in zip(self._sensors, np.split(distances, self._ends), strict=True):
            noise = sensor.noise * self._random.standard_normal()
            readings.append(sensor.reading(float(own.min()) + noise))
        return readings
