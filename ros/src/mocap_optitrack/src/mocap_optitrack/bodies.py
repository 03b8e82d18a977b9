"""Bodies that are published: entries of ``rigid_bodies`` and ``single_markers``."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar

from typing_extensions import override

from crazyflie_model.angles import Triple
from crazyflie_utils.parameters.declaration import Complaints, Parameters, parameter
from crazyflie_utils.parameters.types import (
    FRAME,
    POSITION,
    TEXT,
    TOPIC,
    Converted,
    ListOf,
    Number,
)
from crazyflie_utils.text import shortened, shown
from mocap_optitrack.marker_motion import MotionLimits
from mocap_optitrack.marker_tracker import SEPARATION, MarkerVehicle


class Body(Parameters):
    """A body that is to be published, as its entry in a dictionary says."""

    pose: str | None = parameter(
        TOPIC, "topic; a relative name is below the node's: `/mocap_node/Robot_1/pose`", None
    )
    pose2d: str | None = parameter(TOPIC, "topic, likewise", None)
    child_frame_id: str | None = parameter(FRAME, "tf frame of the body", None)
    parent_frame_id: str = parameter(FRAME, "tf frame of the coordinates", "world")
    key: str = ""  #: Key of the entry.
    unknown: tuple[str, ...] = ()  #: Names in the entry that are not parameters.

    kind: ClassVar = "rigid body"  #: What it is, in messages.
    dictionary: ClassVar = "rigid_bodies"  #: Where its entry is.
    #: Parameters of which it has at least one.
    outputs: ClassVar[tuple[str, ...]] = ("pose", "pose2d", "child_frame_id")

    @property
    def name(self) -> str | None:
        """Name on the server; None for a body that has none, or is found by its number."""
        return None

    @property
    def label(self) -> str:
        """Name of the body in messages."""
        return self.key if self.name in (None, self.key) else f"{self.key} ({self.name})"

    @property
    def component(self) -> str:
        """Name of the body in the diagnostics."""
        return f"{self.kind} {self.label}"


class RigidBody(Body):
    """A rigid body; its key is its number in the stream, or its name."""

    own_name: str | None = parameter(
        TEXT,
        "name on the server, if it is not the key; without it a number is a streaming ID",
        None,
        "name",
    )

    @property
    @override
    def name(self) -> str | None:
        if self.own_name is None and not self.key.isdecimal():
            return self.key
        return self.own_name


class SingleMarker(Body):
    """A vehicle with one marker, which is to be published."""

    kind = "single marker"
    dictionary = "single_markers"
    outputs = ("position", *Body.outputs)

    initial_position: Triple = parameter(
        POSITION,
        "position of the vehicle at the start of the node, in the frame of the coordinates",
    )
    position: str | None = parameter(
        TOPIC, "topic of its position, such as the driver's `/cf1/external_position`", None
    )
    heading: str | None = parameter(
        TOPIC,
        "topic that is read: the vehicle's own estimate of its yaw, such as the driver's "
        "`/cf1/heading`; needed for poses and tf",
        None,
    )
    offset: Triple = parameter(
        POSITION,
        "vector from the marker to the vehicle, along the axes of the coordinates",
        (0.0,) * 3,
    )
    max_velocity: Triple = parameter(
        ListOf(Number("m/s", above=0.0), 3),
        "largest velocity along x, y and z",
        MotionLimits().max_velocity,
    )
    max_acceleration: float = parameter(
        Number("m/s^2", above=0.0),
        "largest acceleration; with a lower one, an unseen marker is distinguished from others "
        "for longer",
        MotionLimits().max_acceleration,
    )

    @override
    def complaints(self) -> Iterator[str]:
        if self.heading is None and (self.pose or self.pose2d or self.child_frame_id):
            yield "heading is not set; expected a topic, since one marker does not tell the yaw"

    @property
    def vehicle(self) -> MarkerVehicle:
        """Configuration for the tracker; its marker is at the start point less `offset`."""
        x, y, z = (a - b for a, b in zip(self.initial_position, self.offset, strict=True))
        limits = MotionLimits(self.max_velocity, self.max_acceleration)
        return MarkerVehicle(self.key, (x, y, z), limits)


def _bodies(body_type, value):
    if not isinstance(value, dict) or not value:
        raise ValueError
    known = {declaration.name for declaration in body_type.declarations()}
    bodies, complaints = [], Complaints()
    for key, entry in value.items():
        label = shortened(str(key))
        if not isinstance(entry, dict):
            complaints.append(f"{label} is {shown(entry)}; expected a dictionary")
            continue
        unknown = tuple(shortened(str(name)) for name in entry if name not in known)
        with complaints:
            values = {name: entry[name] for name in entry if name in known}
            body = body_type.from_mapping(values, f"{label}/")
            bodies.append(replace(body, key=str(key), unknown=unknown))
            if not any(getattr(body, name) for name in body_type.outputs):
                complaints.append(f"{label} has neither {' nor '.join(body_type.outputs)}")
    complaints += shared_outputs(bodies)
    complaints += _shared("name", [(b, b.name) for b in bodies])
    complaints += _too_near([body for body in bodies if isinstance(body, SingleMarker)])
    if complaints:
        raise ValueError("; ".join(complaints))
    return bodies


def _too_near(markers):
    for first, second in itertools.combinations(markers, 2):
        distance = math.dist(*(each.initial_position for each in (first, second)))
        if distance < SEPARATION:
            yield (
                f"{second.key}/initial_position is {distance:.3g} m from that of {first.key}; "
                f"expected at least {SEPARATION:g} m, since markers are distinguished by their "
                "places"
            )


#: The dictionaries ``rigid_bodies`` and ``single_markers``; a refusal names all errors.
RIGID_BODIES = Converted(
    partial(_bodies, RigidBody),
    "a dictionary of number or name of a body: {pose, pose2d, child_frame_id, parent_frame_id}",
    "dictionary",
)
SINGLE_MARKERS = Converted(
    partial(_bodies, SingleMarker),
    "a dictionary of name of a vehicle: {initial_position, position, heading, child_frame_id, "
    "parent_frame_id}",
    "dictionary",
)


def shared_outputs(bodies: Sequence[Body]) -> Iterator[str]:
    """Yield a text about each topic and frame that two bodies share."""
    topics = [
        (body, getattr(body, name, None))
        for body in bodies
        for name in ("pose", "pose2d", "position")
    ]
    yield from _shared("topic", topics)
    yield from _shared("child_frame_id", [(b, b.child_frame_id) for b in bodies])


def _shared(what, owned):
    owners: dict[str, str] = {}
    for body, value in owned:
        if value in owners:
            yield f"{owners[value]} and {body.key} share {what} {shown(value)}"
        elif value is not None:
            owners[value] = body.key
