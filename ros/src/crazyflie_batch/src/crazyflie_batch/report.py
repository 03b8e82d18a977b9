"""Results of a Monte-Carlo run: flights within limits, worst case, sensitivities."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, rankdata

from crazyflie_batch.monte_carlo import OUTCOMES
from crazyflie_batch.settings import Settings

QUINTILES = 5  #: Groups of equal size into which flights are divided by a parameter.


@dataclass(frozen=True)
class Findings:
    """Parameters and outcomes of all flights."""

    settings: Settings
    values: dict[str, NDArray[np.float64]]  #: Swept parameters; see `Settings.values`.
    #: Name in `crazyflie_batch.Flights` -> array of all flights.
    outcomes: dict[str, NDArray[np.float64]]
    is_within: NDArray[np.bool_]  #: Shape (flights,). Whether they stayed within limits.

    @property
    def worst(self) -> int:
        """Number of the worst flight; a crashed one, if any has crashed."""
        crashed = self.outcomes["has_crashed"]
        return int(np.lexsort((_finite(self.outcomes["largest_error"]), crashed))[-1])

    def sensitivities(self) -> dict[str, float]:
        """Return the rank correlation of each parameter with the largest error, in [-1, 1].

        Spearman's; a crash ranks behind all others. It is about 0 for a parameter that increases
        the error in both directions: see `quintiles`.
        """
        error = _finite(self.outcomes["largest_error"])
        crashed = self.outcomes["has_crashed"] > 0.0
        ranks = rankdata(np.where(crashed, error.max() + 1.0, error))
        return {name: _correlation(rankdata(part), ranks) for name, part in self.values.items()}

    def quintiles(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return, for each quintile of a parameter, its mean and the fraction within limits."""
        order = np.argsort(self.values[name], kind="stable")
        parts = [part for part in np.array_split(order, QUINTILES) if len(part)]
        means = [self.values[name][part].mean() for part in parts]
        return np.array(means), np.array([self.is_within[part].mean() for part in parts])


def findings(settings: Settings, outcomes: NDArray[np.float64]) -> Findings:
    """Return what outcomes, shape (flights, len(OUTCOMES)), mean."""
    columns = dict(zip(OUTCOMES, outcomes.T, strict=True))
    is_within = (
        (columns["has_crashed"] == 0.0)
        & (columns["largest_error"] <= settings.run.largest_error)
        & (columns["largest_tilt"] <= settings.run.largest_tilt)
    )
    return Findings(settings, settings.values(), columns, is_within)


def table(found: Findings) -> str:
    """Return the findings as text."""
    run, flights = found.settings.run, len(found.is_within)
    low, high = binomtest(int(found.is_within.sum()), flights).proportion_ci(method="wilson")
    confidence = f"{low:.1%} to {high:.1%} with 95 % confidence"
    limits = f"error at most {run.largest_error:g} m after {run.settle_time:g} s"
    lines = [
        f"{flights} flights of {run.duration:g} s, model {run.model}, seed {run.seed}",
        "",
        f"within limits   {found.is_within.mean():.1%}   ({confidence})",
        f"                {limits}, tilt at most {run.largest_tilt:g} rad, no crash",
        f"crashed         {found.outcomes['has_crashed'].mean():.1%}",
        "",
        f"{'':22}{'median':>10}{'95 %':>10}{'worst':>10}",
    ]
    for label, name in (
        ("largest error, m", "largest_error"),
        ("rms error, m", "rms_error"),
        ("largest tilt, rad", "largest_tilt"),
        ("largest speed, m/s", "largest_speed"),
    ):
        part = _finite(found.outcomes[name])
        lines.append(
            f"{label:22}{np.median(part):10.3g}{np.quantile(part, 0.95):10.3g}{part.max():10.3g}"
        )
    lines += ["", f"worst flight    number {found.worst}"]
    for sweep in found.settings.sweeps:
        value = found.values[sweep.name][found.worst]
        lines.append(f"                {sweep.name} {value:.4g} {sweep.unit}".rstrip())
    lines += [
        "",
        "sensitivity of the largest error (rank correlation, -1 to 1), and the fraction within",
        "limits in each quintile of the parameter, from the lowest values to the highest",
    ]
    sensitivities = found.sensitivities()
    for name in sorted(sensitivities, key=lambda each: -abs(sensitivities[each])):
        fractions = "".join(f"{fraction:8.0%}" for fraction in found.quintiles(name)[1])
        lines.append(f"{name:22}{sensitivities[name]:10.2f}  {fractions}")
    return "\n".join(lines)


def write_csv(found: Findings, path: Path) -> None:
    """Write a row for each flight."""
    columns = {**found.values, **found.outcomes, "is_within": found.is_within}
    rows = np.column_stack([np.arange(len(found.is_within)), *columns.values()])
    header = ",".join(["flight", *columns])
    np.savetxt(path, rows, "%.9g", ",", "\r\n", header, comments="")


def _correlation(a, b):
    """Return the correlation; 0 where one is constant."""
    a, b = a - a.mean(), b - b.mean()
    size = math.sqrt((a @ a) * (b @ b))
    return float(a @ b) / size if size > 0.0 else 0.0


def _finite(values):
    return np.nan_to_num(values, nan=np.finfo(float).max)
