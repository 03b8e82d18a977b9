"""Parameters of the firmware that trigger an action when they are written. Needs no cflib."""

#: Groups of parameters, and parameters, that make the vehicle turn its motors, stop, arm, restart.
_ACTING_GROUPS = frozenset({"health", "motorPowerSet", "system"})
_ACTING = frozenset({"stabilizer.stop", "supervisor.infdmp"})
#: A parameter, and a part of names, that have it forget.
_FORGETTING = frozenset({"flightmode.yawRst"})
_FORGETTING_WORD = "reset"


def acts(name: str) -> bool:
    """Return whether writing a parameter, such as "health.startPropTest", moves or stops it."""
    return name.partition(".")[0] in _ACTING_GROUPS or name in _ACTING


def is_trigger(name: str) -> bool:
    """Return whether a parameter, such as "kalman.resetEstimation", triggers an action.

    It is not a state that a vehicle has lost when it was off: it must not be written again.
    """
    forgets = _FORGETTING_WORD in name.partition(".")[2].lower() or name in _FORGETTING
    return forgets or acts(name)
