"""Recordings as MCAP, for Foxglove and Lichtblick: frames, markers, log, and numbers to plot.

The output is a ROS 2 bag, written by PyPI's rosbags, with the types of this workspace.
"""

import heapq
import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_reports.bag_events import Kind
from crazyflie_reports.bag_flights import Vehicle, vehicles
from crazyflie_reports.bag_log import BagLog
from crazyflie_reports.bag_ros2 import message, ros2_name, types

FIXED = "world"  #: The frame of positions.

ARM, ROTOR = 0.046, 0.023  #: Half of the diagonal of a Crazyflie, radius of a propeller (m).
PATH_POINTS = 2000  #: Points of a path's marker.

_STATE, _CONTROL = "crazyflie_msgs/PositionVelocityYawStateStamped", "crazyflie_msgs/ControlStamped"
_STATUS = "crazyflie_msgs/FlightStatus"
_LINE_STRIP, _LINE_LIST, _SPHERE, _CYLINDER, _TEXT = 4, 5, 2, 3, 9  # Types of a Marker.
_WARN, _ERROR = 30, 40  # Levels of a Log.
_ERRORS = (Kind.ERROR, Kind.EMERGENCY)

Timed = tuple[float, str, str, Any]  # Time (s), topic, type, fields as `bag_ros2.message` has them.


def write(log: BagLog, folder: Path) -> Path:
    """Write a recording into a new folder, which must not exist; return the file."""
    writer = Writer(folder, version=8, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    connections: dict[str, Any] = {}
    with writer:
        # One vehicle's numbers are in memory at a time; MCAP's index has the order.
        for messages in (*map(_of_vehicle, vehicles(log)), _events(log)):
            for time, topic, datatype, fields in messages:
                name = ros2_name(datatype)
                data = types().serialize_cdr(message(datatype, fields), name)
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, name, typestore=types())
                writer.write(connections[topic], round(time * 1e9), data)
    return folder / f"{folder.name}.mcap"


def _header(time, frame=FIXED):
    return _stamp(time), frame


def _stamp(time):
    return divmod(round(time * 1e9), 10**9)


def _of_vehicle(vehicle: Vehicle) -> Iterator[Timed]:
    """Yield the messages of a vehicle in the order of their times."""
    top, name = f"/{vehicle.name}", vehicle.name
    yaw = np.nan_to_num(vehicle.state[:, 7:8])
    flat = np.zeros((len(yaw), 2))
    poses = vehicle.attitude
    if not len(poses):
        poses = np.hstack([vehicle.state[:, :4], flat, yaw])

    def series(topic, datatype, rows, made):
        return ((row[0], topic, datatype, made(row)) for row in rows)

    def numbers(row):
        return _header(row[0]), row[1:]

    def status(row):
        return {"header": _header(row[0]), "state": row[1]}

    yield from _model(name, top, poses)
    yield from heapq.merge(
        series("/tf", "tf2_msgs/TFMessage", poses, partial(_transform, name)),
        (
            (row[0], f"{top}/state", _STATE, (_header(stamp), row[1:]))
            for row, (_, stamp) in zip(vehicle.state, vehicle.stamps, strict=True)
        ),
        series(f"{top}/ref", _STATE, vehicle.reference, numbers),
        _references(name, top, vehicle.reference),
        series(f"{top}/control/final", _CONTROL, vehicle.control, numbers),
        series(f"{top}/battery", "std_msgs/Float32", vehicle.battery, lambda row: row[1:]),
        series(f"{top}/in_flight_flight_status", _STATUS, sorted(vehicle.flight_states), status),
        key=lambda each: each[0],
    )


def _transform(name, row):
    transform = row[1:4], quaternion_from_rpy(*row[4:7])
    return ([(_header(row[0]), name, transform)],)


def _marker(time, name, kind, size, color, frame=FIXED, place=(0.0, 0.0, 0.0), **fields):
    return {
        "header": _header(time, frame),
        "ns": name,
        "type": kind,
        "pose": (place, (0.0, 0.0, 0.0, 1.0)),
        "scale": size,
        "color": (*color, 1.0),
        **fields,
    }


def _markers(time, topic, markers):
    array = [{**marker, "id": number} for number, marker in enumerate(markers)]
    return time, topic, "visualization_msgs/MarkerArray", (array,)


def _model(name: str, top: str, poses: np.ndarray) -> Iterator[Timed]:
    """Yield the permanent markers: the vehicle, which moves with its frame, and its path."""
    if not len(poses):
        return
    time, edge = float(poses[0, 0]), ARM / math.sqrt(2.0)
    ends = [(a * edge, b * edge, 0.0) for a in (1, -1) for b in (1, -1)]
    dark, light, blue = (0.1, 0.13, 0.19), (0.6, 0.64, 0.7), (0.0, 0.45, 0.7)
    arms = [point for end in ends for point in ((0.0, 0.0, 0.0), end)]
    own = {"frame": name, "frame_locked": True}
    marker = partial(_marker, time, name)
    parts = [marker(_LINE_LIST, (0.006, 0.0, 0.0), dark, points=arms, **own)]
    for place in ends:
        # The front propellers are dark.
        color = dark if place[0] > 0.0 else light
        parts.append(marker(_CYLINDER, (2 * ROTOR, 2 * ROTOR, 0.004), color, place=place, **own))
    parts.append(marker(_TEXT, (0.0, 0.0, 0.05), dark, place=(0, 0, 0.08), text=name, **own))
    yield _markers(time, f"{top}/model", parts)
    path = poses[:: 1 + len(poses) // PATH_POINTS, 1:4]
    line = marker(_LINE_STRIP, (0.005, 0.0, 0.0), blue, points=list(path))
    yield _markers(time, f"{top}/path", [line])


def _references(name, top, rows):
    for row in rows:
        if np.isfinite(row[1:4]).all():
            size, purple = (0.04, 0.04, 0.04), (0.48, 0.25, 0.63)
            sphere = _marker(row[0], name, _SPHERE, size, purple, place=row[1:4])
            yield _markers(row[0], f"{top}/reference", [sphere])


def _events(log: BagLog) -> Iterator[Timed]:
    """Yield the recording's events as lines of a log."""
    for event in log.events.events:
        line = {
            "stamp": _stamp(event.time),
            "level": _ERROR if event.kind in _ERRORS else _WARN,
            "name": event.namespace or "flight",
            "msg": f"{event.kind.value}: {event.text}",
        }
        yield event.time, "/rosout", "rcl_interfaces/Log", line
