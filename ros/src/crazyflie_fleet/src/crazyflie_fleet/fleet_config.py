"""Vehicles that fly together."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from crazyflie_driver.positioning import MOCAP
from crazyflie_fleet.settings import MachineSettings, RobotSettings

#: Vertical distance of two vehicles over their horizontal one: the downwash of the rotors reduces
#: the lift of a vehicle below.
DOWNWASH = 2.0

#: Parameter below a vehicle's name: its collision buffer, by which others plan (m).
BUFFER = "buffer"


@dataclass(frozen=True)
class LogTopic:
    """A topic of firmware variables."""

    name: str  # Below the vehicle's namespace.
    frequency: float  # Frequency of the messages (Hz).
    variables: tuple[str, ...]  # Such as "pm.vbat".


@dataclass(frozen=True)
class VehicleConfig:
    """One vehicle."""

    name: str  # Its namespace and its tf frame.
    position: tuple[float, float, float]  # Before takeoff (m, fixed frame).
    settings: RobotSettings  # Merged from the vehicle, its type and ``all``.
    # "group.name" to value, written after each connection.
    firmware_params: Mapping[str, float] = dataclasses.field(default_factory=dict)
    default_topics: tuple[str, ...] = ("battery",)  # Standard ones that the driver publishes.
    log_topics: tuple[LogTopic, ...] = ()

    @property
    def uri(self) -> str | None:
        """Its address, if it has one."""
        return self.settings.uri

    @property
    def buffer(self) -> float:
        """Radius of its collision ellipsoid, m; `DOWNWASH` times as high."""
        return self.settings.buffer

    @property
    def hover_point(self) -> tuple[float, float, float]:
        """Position x, y, z at the end of a takeoff, m."""
        x, y, z = self.position
        return x, y, z + self.settings.hover_height

    @property
    def mocap_frame(self) -> str:
        """Name of its tf frame from motion capture, or of its own estimate."""
        if self.settings.positioning != MOCAP:
            return f"{self.name}/estimate"
        return self.settings.mocap_frame or self.name

    @property
    def battery_limits(self) -> tuple[float, float]:
        """Voltages below which a takeoff is refused, and below which the vehicle is landed, V."""
        own = self.settings if self.settings.voltages_act else RobotSettings
        return own.voltage_warning, own.voltage_critical


@dataclass(frozen=True)
class FleetConfig:
    """The vehicles that take part."""

    vehicles: tuple[VehicleConfig, ...]  # Those that are enabled, in the order of the file.
    disabled: tuple[str, ...] = ()  # Names of the others.
    machines: Mapping[str, MachineSettings] = dataclasses.field(default_factory=dict)
    warnings: tuple[str, ...] = ()  # Remarks on the file: line and reason.
    # Parameters of the driver's broadcasts.
    broadcasts: Mapping[str, float] = dataclasses.field(default_factory=dict)
    # Pairs of names of vehicles whose start points are closer than their buffers.
    unplaced: tuple[tuple[str, str], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vehicles that take part."""
        return tuple(vehicle.name for vehicle in self.vehicles)

    def at_ports(self, first_port: int) -> "FleetConfig":
        """Return the same vehicles at UDP ports of this computer, one after the other."""
        vehicles = tuple(
            dataclasses.replace(
                vehicle,
                settings=dataclasses.replace(
                    vehicle.settings, uri=f"udp://127.0.0.1:{first_port + number}"
                ),
            )
            for number, vehicle in enumerate(self.vehicles)
        )
        return dataclasses.replace(self, vehicles=vehicles)

    def positioned_by(self, source: str) -> "FleetConfig":
        """Return the same vehicles with another source of their poses, of `SOURCES`."""
        vehicles = tuple(
            dataclasses.replace(
                vehicle, settings=dataclasses.replace(vehicle.settings, positioning=source)
            )
            for vehicle in self.vehicles
        )
        return dataclasses.replace(self, vehicles=vehicles)

    def __getitem__(self, name: str) -> VehicleConfig:
        """Return a vehicle that takes part; raises KeyError."""
        for vehicle in self.vehicles:
            if vehicle.name == name:
                return vehicle
        raise KeyError(name)


def close_pairs(
    positions: npt.NDArray[np.float64], buffers: Sequence[float] | npt.NDArray[np.float64]
) -> Iterator[tuple[int, int, float, float]]:
    """Yield the pairs of places that are closer than the buffers of their vehicles.

    Parameters
    ----------
    positions : (n, 3) array
        x, y, z in m.
    buffers : (n,) array
        Radii, m.

    Yields
    ------
    i, j : int
        With i < j.
    distance, allowed : float
        m; heights are divided by `DOWNWASH`.
    """
    radii = np.asarray(buffers, dtype=float)
    if len(radii) < 2:
        return
    scaled = np.array(positions, dtype=float).reshape(-1, 3)
    scaled[:, 2] /= DOWNWASH
    pairs = cKDTree(scaled).query_pairs(2.0 * float(radii.max()), output_type="ndarray")
    distances = np.linalg.norm(scaled[pairs[:, 0]] - scaled[pairs[:, 1]], axis=1)
    allowed = radii[pairs[:, 0]] + radii[pairs[:, 1]]
    for (i, j), distance, limit in zip(pairs, distances, allowed, strict=True):
        if distance < limit:
            yield int(i), int(j), float(distance), float(limit)
