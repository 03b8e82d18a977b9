"""Notices when a vehicle that is to land does not come down."""

PATIENCE = 1.5
"""How long a vehicle that is to land may stay up, s."""

PROGRESS = 0.02
"""Less than this below where it was highest is no way down, m."""


class DescentWatch:
    """Watches the height of a vehicle that is to land."""

    def __init__(self) -> None:
        self._mark: float | None = None
        self._lasted = 0.0

    def advance(self, step: float, z: float | None) -> str:
        """Let time pass; return in words what is wrong, or an empty text.

        Parameters
        ----------
        step : float
            s.
        z : float or None
            Height, m; None while the vehicle is not to land, or its height is not known.
        """
        if z is None or self._mark is None or z <= self._mark - PROGRESS:
            self._mark = z
            self._lasted = 0.0
            return ""
        self._mark = max(self._mark, z)
        self._lasted += step
        if self._lasted <= PATIENCE:
            return ""
        return f"the vehicle has not come down for {PATIENCE:g} s of a landing"
