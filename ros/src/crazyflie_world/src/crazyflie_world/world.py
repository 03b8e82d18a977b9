"""A room: its floor, and its fixed or moving objects."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import FRAME, ListOf, Text
from crazyflie_world.shapes import COLOUR, LENGTH, Box, Colour, Position, Shape, cast

FLOOR = "floor"  #: Name of the floor among the solids.
TEXTURES = ("plain", "checkers", "speckles")  #: Textures of floors.


class Floor(Parameters):
    """The floor: the plane z = 0, with its middle in the origin; as in a world file."""

    size: tuple[float, float] = parameter(ListOf(LENGTH, 2), "size along x and y")
    texture: str = parameter(Text(TEXTURES), "texture for cameras", "plain")
    colour: Colour = parameter(COLOUR, "red, green, blue", (0.6, 0.6, 0.6))

    def solid(self) -> Box:
        """Return the floor as a box without thickness."""
        return Box(name=FLOOR, centre=(0.0, 0.0, 0.0), extent=(*self.size, 0.0), colour=self.colour)


class World(Parameters):
    """A floor and objects, at one moment; all but the objects as declared in a world file."""

    frame: str = parameter(FRAME, "tf frame of all positions", default="world")
    floor: Floor = group(Floor, "floor")
    objects: tuple[Shape, ...] = ()  #: Objects; walls are boxes.

    @property
    def solids(self) -> tuple[Shape, ...]:
        """The objects, then the floor."""
        return (*self.objects, self.floor.solid())

    @property
    def moving(self) -> tuple[Shape, ...]:
        """The objects that have a path."""
        return tuple(each for each in self.objects if each.path is not None)

    def __getitem__(self, name: str) -> Shape:
        """Return the object with this name, or raise KeyError."""
        for each in self.objects:
            if each.name == name:
                return each
        raise KeyError(name)

    def at(self, time: float) -> Self:
        """Return the world ``time`` seconds after paths begin."""
        centres = {e.name: e.path.position(time) for e in self.objects if e.path is not None}
        return self.placed(centres)

    def placed(self, centres: Mapping[str, Position]) -> Self:
        """Return the world with some objects at other places, name -> centre (m)."""
        return replace(
            self,
            objects=tuple(
                each.moved_to(centres[each.name]) if each.name in centres else each
                for each in self.objects
            ),
        )

    def cast(
        self, origins: ArrayLike, directions: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return distance and index of the first of the `solids` on rays.

        See `shapes.cast`.
        """
        return cast(self.solids, origins, directions)
