"""How a server that has just started finds out where the flight stands.

It may be the first on the ground, or take the place of one that died at any moment.
There are two sources: the control filter, which keeps the flight state that the former
server published, or else tells whether a controller sends commands; and the measured
height above the ground. If there is a flight state, the ground is where the former server took
off, by the parameter that it has left; else it is taken to be at z = 0. A filter that has only
just started, too, is evidence of a fresh launch, whatever a controller commands: it does not tell
of commands in its first seconds.
"""

from dataclasses import dataclass

from crazyflie_takeoff.flight import TOUCHDOWN_HEIGHT
from crazyflie_takeoff.flight_state import FlightState, Takeover

FLYING_HEIGHT = 0.15
"""A vehicle above this height is flying if nobody knows better, m."""


@dataclass(frozen=True)
class RecoveredState:
    """Where a flight stands.

    Attributes
    ----------
    state : FlightState
        ON_GROUND, FLYING or, to finish what the former server began, DESCENDING or LANDING.
    announced : bool
        Whether the world has been told (by toggles) that the vehicle is in flight.
    reason : str
        For the log.
    is_lost : bool
        Whether the filter is bringing the vehicle down.
    """

    state: FlightState
    announced: bool
    reason: str
    is_lost: bool = False


def recover_state(
    remembered: FlightState | None,
    height: float | None,
    can_descend: bool = True,
    is_commanded: bool = True,
    takeover: Takeover | None = None,
) -> RecoveredState:
    """Return where the flight stands.

    In doubt it is FLYING: the controller keeps the vehicle, and the operator can
    land. A vehicle that is high up although nothing is remembered and no controller
    sends commands stands on something. An interrupted takeoff or landing is landed if the
    height is known: its caller, who got an error, expects the vehicle to be safe.

    Parameters
    ----------
    remembered : FlightState or None
        What the filter remembers; None when it knows nothing, or there is none.
    height : float or None
        Above the ground, m; None when it is not known.
    can_descend : bool
        Whether landings begin with a descent.
    is_commanded : bool
        Whether a controller sends commands, or may do so.
    takeover : Takeover or None
        What the filter has done by itself.

    Returns
    -------
    RecoveredState
    """
    if takeover is not None:
        return _after(takeover, remembered)
    seen = "the height is not known" if height is None else f"the height is {height:.2f} m"
    said = "nothing is remembered" if remembered is None else f"{remembered.value} is remembered"
    state = _conclude(remembered, height, can_descend, is_commanded)
    announced = state.in_flight if remembered is None else remembered.in_flight
    return RecoveredState(state, announced, f"{said}, {seen}")


def _after(takeover, remembered):
    announced = remembered is not None and remembered.in_flight
    said = f"the filter says {takeover.value}"
    if takeover is Takeover.SINKING:
        return RecoveredState(FlightState.LANDING, announced, said, is_lost=True)
    return RecoveredState(FlightState.ON_GROUND, announced, said)


def _conclude(remembered, height, can_descend, is_commanded):
    if remembered is None:
        is_high = height is not None and height > FLYING_HEIGHT
        return FlightState.FLYING if is_high and is_commanded else FlightState.ON_GROUND
    if not remembered.is_settled:
        if height is not None and height < TOUCHDOWN_HEIGHT:
            return FlightState.LANDING
        if height is not None and can_descend:
            return FlightState.DESCENDING
        return FlightState.FLYING
    return remembered
