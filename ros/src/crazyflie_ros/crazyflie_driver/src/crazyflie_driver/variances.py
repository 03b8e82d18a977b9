"""Whether a vehicle's Kalman filter has converged, by the variances of its velocity."""

import threading

VARIABLES = ("kalman.varPX", "kalman.varPY", "kalman.varPZ")  #: Log variables, m^2/s^2.

PERIOD_MS = 500
WINDOW = 10
#: Within `WINDOW` samples of this period a variance changes by less, m^2/s^2, once the filter has
#: converged: as cflib.crazyflie.reset_estimator has it. A shorter window is held to the same rate.
MAX_CHANGE = 0.001

FEWEST = 3  #: Samples that show it.
_LIMIT = 2.0  #: Time in which so many come after the link has been set up, s.


class Variances:
    """The latest samples of the variances; added in one thread, looked at in another."""

    def __init__(self) -> None:
        self._samples: tuple[tuple[float, ...], ...] = ()
        self._came = threading.Condition()
        self.is_logged = False

    def add(self, sample: tuple[float, ...]) -> None:
        """Add a sample of `VARIABLES`."""
        with self._came:
            self._samples = (*self._samples, sample)[-WINDOW:]
            self._came.notify_all()

    def clear(self) -> None:
        """Forget all samples: the filter may have begun anew."""
        self._samples = ()

    def problem(self) -> str:
        """Return what shows that the filter has not converged, empty if nothing does.

        Blocks until there are samples, if they are logged; without any, nothing is known.
        """
        if not self.is_logged:
            return ""
        with self._came:
            self._came.wait_for(lambda: len(self._samples) >= FEWEST, _LIMIT)
            samples = self._samples
        if len(samples) < FEWEST:
            return ""
        windows = [samples[-size:] for size in range(FEWEST, len(samples) + 1)]
        problems = [_excess(window) for window in windows]
        # Of the longest one.
        return "" if "" in problems else problems[-1]


def _excess(window):
    span = (len(window) - 1) * PERIOD_MS / 1000.0
    most = MAX_CHANGE * (len(window) - 1) / (WINDOW - 1)
    changes = [max(values) - min(values) for values in zip(*window, strict=True)]
    worst = max(range(len(changes)), key=changes.__getitem__)
    # A change that is not a number is too large as well.
    if all(change < most for change in changes):
        return ""
    return (
        f"{VARIABLES[worst]} has changed by {changes[worst]:.2g} m^2/s^2 within {span:g} s; "
        f"expected less than {most:.2g}"
    )
