"""Worlds in YAML files."""

import os
from dataclasses import replace
from pathlib import Path as FilePath

from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.declaration import Complaints
from crazyflie_utils.parameters.types import Text, path_of
from crazyflie_utils.parameters.yaml_file import Entry
from crazyflie_utils.text import shortened, shown
from crazyflie_utils.text_file import user_path
from crazyflie_world.shapes import Ball, Box, Circle, Cylinder, Path, Shape, Wall, Waypoints
from crazyflie_world.world import FLOOR, World

#: Objects that may move, by their type.
OBJECTS: dict[str, type[Shape]] = {"box": Box, "cylinder": Cylinder, "ball": Ball}

WALL = "wall"

PATHS: dict[str, type[Path]] = {"circle": Circle, "waypoints": Waypoints}  #: Paths, by their type.


def load(path: str | FilePath) -> World:
    """Return the world in a file.

    `ParameterError` names all errors: file, line and what was expected.
    """
    file = yaml_file.load(path)
    world = file.read(World, extra_keys=("objects",))
    entries = file["objects"].elements() if "objects" in file else []
    objects: list[Shape] = []
    complaints = Complaints()
    lines = {FLOOR: "the floor", world.frame: "the frame"}
    for entry in entries:
        with complaints:
            made = _object(entry)
            name = entry["name"]
            if made.name in lines:
                raise name.error(f"is {shown(made.name)}, which is the name of {lines[made.name]}")
            lines[made.name] = f"the object in line {name.line}"
            objects.append(made)
    complaints.raise_any()
    return replace(world, objects=tuple(objects))


WORLD_FILE = path_of(load, "a world file")


def _object(entry: Entry) -> Shape:
    kind = entry["type"].checked(Text((*OBJECTS, WALL)))
    if kind == WALL:
        return entry.read(Wall, extra_keys=("type",)).box()
    path = _path(entry["path"]) if "path" in entry else None
    shape = entry.read(OBJECTS[kind], extra_keys=("type", "path"))
    if ("centre" in entry) == (path is not None):
        raise entry.error("has both a centre and a path, or neither; expected one of them")
    if path is not None:
        shape = replace(shape, path=path, centre=path.position(0.0))
    return _with_picture(shape, entry)


def _with_picture(shape: Shape, entry: Entry) -> Shape:
    # The picture's name is relative to the world file.
    if not isinstance(shape, Box) or not shape.picture:
        return shape
    picture = (entry.file.parent / user_path(shape.picture)).absolute()
    # Unlike pathlib's, this accepts a name that is too long for a file.
    if not os.path.isfile(picture):
        raise entry["picture"].error(
            f"is {shown(shape.picture)}; expected a file; {shortened(str(picture))} is not one"
        )
    return replace(shape, picture=str(picture))


def _path(entry: Entry) -> Path:
    return entry.read(PATHS[entry["type"].checked(Text(tuple(PATHS)))], extra_keys=("type",))
