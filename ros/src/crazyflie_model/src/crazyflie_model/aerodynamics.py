"""Air that rotors move: the lift near the ground, and the downwash on vehicles below.

Sources:

[C] I. C. Cheeseman and W. E. Bennett, The effect of the ground on a helicopter rotor in forward
flight, Aeronautical Research Council R&M 3021, 1955.
[J] K. P. Jain, T. Fortmuller, J. Byun, S. A. Makiharju, M. W. Mueller, Modeling of aerodynamic
disturbances for proximity flight of multirotors, ICUAS 2019: below a multirotor the flows of its
rotors merge into one turbulent jet.
[P] S. B. Pope, Turbulent Flows, 2000, section 5.1: velocity and width of a round jet.
"""

import math
from collections.abc import Hashable

from crazyflie_model.angles import Triple
from crazyflie_model.elementwise import Number, clip

_ROTOR_RADIUS = 0.023  #: m: propellers of 46 mm.
_ROTOR_HEIGHT = 0.02  #: Height of the rotors above the feet (m): assumed.
_DENSITY = 1.225  #: Of air, kg/m^3.

#: Decay of the velocity at the centre of a jet, and its half-width over the distance [P].
_DECAY, _SPREAD = 5.8, 0.094
#: Least half-width of a jet (m): where the rotors' flows merge, that of the vehicle.
_LEAST_WIDTH = 0.07
#: Distances, below and aside, beyond which a wake is not felt (m): there it is slower than 0.1 of
#: its speed near the rotors.
_REACH, _CELL = 4.0, 1.0


def ground_effect(height: Number) -> Number:
    """Return the thrust at a height of the feet (m) over that far above the ground [C]."""
    ratio = _ROTOR_RADIUS / (4.0 * (clip(height, 0.0, math.inf) + _ROTOR_HEIGHT))
    return 1.0 / (1.0 - ratio * ratio)


def wake_speed(below: float, aside: float, thrust: float) -> float:
    """Return the speed of the air (m/s, down) at distances (m) from a vehicle with a thrust (N).

    With [P]: a jet whose flow of momentum is the thrust. Near the rotors it is not faster than the
    momentum theory of a rotor has it.
    """
    if below <= 0.0 or thrust <= 0.0:
        return 0.0
    disks = 4.0 * math.pi * _ROTOR_RADIUS**2
    fastest = math.sqrt(2.0 * thrust / (_DENSITY * disks))
    centre = _DECAY * math.sqrt(4.0 * thrust / (math.pi * _DENSITY)) / below
    ratio = aside / max(_SPREAD * below, _LEAST_WIDTH)
    return min(fastest, centre) / (1.0 + (math.sqrt(2.0) - 1.0) * ratio * ratio) ** 2


class Air:
    """The wakes of vehicles in one space, of which each is felt by those that are near it."""

    def __init__(self) -> None:
        # Cell of the floor -> its vehicles: position and thrust.
        self._cells: dict[tuple[int, int], dict[Hashable, tuple[Triple, float]]] = {}
        self._places: dict[Hashable, tuple[int, int]] = {}

    def move(self, vehicle: Hashable, position: Triple, thrust: float) -> float:
        """Move a vehicle to a position (m) with a thrust (N).

        Return the speed of the air there (m/s, down), by the wakes of all others.
        """
        x, y, z = position
        cell = math.floor(x / _CELL), math.floor(y / _CELL)
        if (before := self._places.get(vehicle)) != cell:
            if before is not None:
                self._cells[before].pop(vehicle, None)
            self._places[vehicle] = cell
        self._cells.setdefault(cell, {})[vehicle] = position, thrust
        speed = 0.0
        for i in range(cell[0] - 1, cell[0] + 2):
            for j in range(cell[1] - 1, cell[1] + 2):
                for other, (place, lift) in tuple(self._cells.get((i, j), {}).items()):
                    below = place[2] - z
                    if other != vehicle and 0.0 < below < _REACH:
                        aside = math.hypot(place[0] - x, place[1] - y)
                        speed += wake_speed(below, aside, lift)
        return speed
