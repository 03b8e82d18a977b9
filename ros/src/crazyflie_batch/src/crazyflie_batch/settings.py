"""Settings of a Monte-Carlo run: a YAML file, checked before the first flight."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rospkg import ResourceNotFound, RosPack
from scipy.special import ndtri

from crazyflie_batch.simulation import time_errors
from crazyflie_lqr.gain_file import GainFileError, load_matrix
from crazyflie_model.limits import CRASH_TILT
from crazyflie_state_estimator import motion
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import DURATION, METRES, SHARE, TEXT, Integer, Number, Text
from crazyflie_utils.parameters.types import FINITE as ANY
from crazyflie_utils.parameters.yaml_file import Entry, load
from crazyflie_utils.text import shortened
from crazyflie_utils.text_file import user_path

MODELS = ("near_hover", "coupled_7d", "quadrotor")
ESTIMATORS = ("finite_difference", "kalman")

_FRACTION = Number(minimum=-0.5, maximum=0.5)
_NOT_NEGATIVE = Number(minimum=0.0)
_SPEED = Number("m/s")


class FlightParameters(Parameters):
    """Parameters that may differ between flights, with those of all others: keys of ``vehicle``."""

    mass_error: float = parameter(_FRACTION, "how much heavier than nominal the vehicle is", 0.0)
    thrust_error: float = parameter(_FRACTION, "how much more than nominal its rotors lift", 0.0)
    wind_x: float = parameter(_SPEED, "constant wind, fixed frame", 0.0)
    wind_y: float = parameter(_SPEED, "constant wind, fixed frame", 0.0)
    wind_z: float = parameter(_SPEED, "constant wind, fixed frame", 0.0)
    position_noise: float = parameter(
        Number("m", minimum=0.0), "standard deviation of the poses' positions, each axis", 0.0
    )
    attitude_noise: float = parameter(
        Number("rad", minimum=0.0), "standard deviation of the poses' attitudes, each axis", 0.0
    )
    delay: float = parameter(
        Number("s", minimum=0.0, maximum=1.0),
        "from a pose to its arrival, rounded up to whole periods",
        0.0,
    )
    dropout: float = parameter(SHARE, "probability that a pose is lost", 0.0)
    position_gain: float = parameter(_NOT_NEGATIVE, "factor of the gains of x and y", 1.0)
    velocity_gain: float = parameter(_NOT_NEGATIVE, "factor of the gains of x_dot and y_dot", 1.0)
    height_gain: float = parameter(_NOT_NEGATIVE, "factor of the gains of z", 1.0)
    climb_gain: float = parameter(_NOT_NEGATIVE, "factor of the gains of z_dot", 1.0)
    yaw_gain: float = parameter(_NOT_NEGATIVE, "factor of the gains of the yaw", 1.0)
    integrator_gain: float = parameter(_NOT_NEGATIVE, "factor of the integrators' gains", 1.0)


_DEFAULTS = FlightParameters.from_mapping({})


class RunParameters(Parameters):
    """Parameters of all flights: the other keys."""

    flights: int = parameter(Integer(1, 10**7), "how many")
    seed: int = parameter(Integer(0, 2**32 - 1), "seed of all random numbers", 0)
    model: str = parameter(Text(MODELS), "see crazyflie_simulator", "quadrotor")
    duration: float = parameter(Number("s", above=0.0, maximum=600.0), "duration of a flight", 20.0)
    period: float = parameter(
        Number("s", above=0.0, maximum=1.0),
        "period of motion capture, estimator and controller; a multiple of 0.002 s",
        0.01,
    )
    settle_time: float = parameter(DURATION, "errors are evaluated from this time on", 10.0)
    estimator: str = parameter(
        Text(ESTIMATORS), "how velocities are found; see crazyflie_state_estimator", ESTIMATORS[0]
    )
    filter_noise: float = parameter(
        Number("m", above=0.0),
        "position noise that the Kalman filter expects",
        motion.POSITION_NOISE,
    )
    filter_walk: float = parameter(
        Number("m/s^2/sqrt(s)", above=0.0),
        "acceleration walk that the Kalman filter expects",
        motion.ACCELERATION_WALK,
    )
    K_file: str = parameter(
        TEXT, "gain file, 4 rows of 7 numbers: next to this file, or in crazyflie_lqr/config"
    )
    integrator_k_x: float = parameter(ANY, "see crazyflie_lqr", 0.0, "integrator/k/x")
    integrator_k_y: float = parameter(ANY, "see crazyflie_lqr", 0.0, "integrator/k/y")
    integrator_k_z: float = parameter(ANY, "see crazyflie_lqr", 0.0, "integrator/k/z")
    integrator_x: float = parameter(_NOT_NEGATIVE, "m s", 0.0, "integrator/thresh/x")
    integrator_y: float = parameter(_NOT_NEGATIVE, "m s", 0.0, "integrator/thresh/y")
    integrator_z: float = parameter(_NOT_NEGATIVE, "m s", 0.0, "integrator/thresh/z")
    start_x: float = parameter(METRES, "where flights begin, at rest", 0.0, "start/x")
    start_y: float = parameter(METRES, "where flights begin, at rest", 0.0, "start/y")
    start_z: float = parameter(METRES, "where flights begin; the ground is 0", 1.0, "start/z")
    goal_x: float = parameter(METRES, "goal of flights", 0.0, "goal/x")
    goal_y: float = parameter(METRES, "goal of flights", 0.0, "goal/y")
    goal_z: float = parameter(METRES, "goal of flights", 1.0, "goal/z")
    goal_yaw: float = parameter(Number("rad"), "heading at the goal", 0.0, "goal/yaw")
    largest_error: float = parameter(
        Number("m", above=0.0), "largest distance from the goal after settling", 0.1, "limits/error"
    )
    largest_tilt: float = parameter(
        Number("rad", above=0.0),
        "largest tilt from upright, also before the vehicle has settled",
        CRASH_TILT,
        "limits/tilt",
    )

    def complaints(self) -> list[str]:
        """See `Parameters.complaints`."""
        return time_errors(self.duration, self.period, self.settle_time)


UNIFORM, NORMAL, VALUES = "uniform", "normal", "values"
_EXPECTED = (
    f"one of {UNIFORM}: [lowest, highest], {NORMAL}: [mean, standard deviation] and "
    f"{VALUES}: [one, another, ...]"
)


@dataclass(frozen=True)
class Sweep:
    """Distribution of a parameter over the flights."""

    name: str  #: Name of a parameter in `FlightParameters`.
    unit: str
    kind: str  #: `UNIFORM`, `NORMAL` or `VALUES`.
    numbers: tuple[float, ...]  #: Lowest and highest; mean and standard deviation; or the values.
    #: low, high: Range of the parameter, to which a normal distribution is cut off.
    low: float
    high: float

    def quantiles(self, fractions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the quantiles of the distribution at these fractions, in [0, 1)."""
        if self.kind == VALUES:
            index = (fractions * len(self.numbers)).astype(int)
            return np.sort(self.numbers)[index]
        first, second = self.numbers
        if self.kind == UNIFORM:
            return first + (second - first) * fractions
        return np.clip(first + second * ndtri(fractions), self.low, self.high)


@dataclass(frozen=True)
class Settings:
    """A Monte-Carlo run; ``name`` is that of the file, and ``K`` has 4 rows of 7 gains."""

    name: str
    run: RunParameters
    vehicle: FlightParameters
    sweeps: tuple[Sweep, ...]
    K: tuple[tuple[float, ...], ...]

    def values(self) -> dict[str, NDArray[np.float64]]:
        """Return the swept parameters by name, arrays of all flights."""
        random = np.random.default_rng(self.run.seed)
        fractions = random.random((len(self.sweeps), self.run.flights))
        pairs = zip(self.sweeps, fractions, strict=True)
        return {sweep.name: sweep.quantiles(part) for sweep, part in pairs}


def read_settings(path: str | Path) -> Settings:
    """Return the settings in a file; `ParameterError` names all errors with file and line."""
    file = load(path)
    run = file.read(RunParameters, extra_keys=("vehicle", "sweep"))
    vehicle = file["vehicle"].read(FlightParameters) if "vehicle" in file else _DEFAULTS
    sweeps = tuple(_sweep(entry, key) for key, entry in file["sweep"].entries().items())
    if not sweeps:
        raise file["sweep"].error("is empty; expected at least one parameter")
    model_only = {"mass_error", "thrust_error", "wind_x", "wind_y", "wind_z"}
    for sweep in sweeps:
        if "vehicle" in file and sweep.name in file["vehicle"]:
            raise file["sweep"][sweep.name].error(
                f"is also in line {file['vehicle'][sweep.name].line} under vehicle; expected "
                "only one of them"
            )
        if run.model != "quadrotor" and sweep.name in model_only:
            raise file["sweep"][sweep.name].error(f"makes no difference to the model {run.model}")
    try:
        K = load_matrix(str(_gain_file(file.file, run.K_file)), 4, 7)
    except GainFileError as error:
        raise file["K_file"].error(f"is {shortened(run.K_file)}: {error}") from None
    return Settings(file.file.stem, run, vehicle, sweeps, tuple(map(tuple, K.tolist())))


def _gain_file(settings: Path, name: str) -> Path:
    local = settings.parent / user_path(name)
    # Unlike pathlib's, this accepts a name that is too long for a file.
    if os.path.exists(local):
        return local
    try:
        shipped = Path(RosPack().get_path("crazyflie_lqr"), "config", name)
    except ResourceNotFound:
        return local
    return shipped if os.path.exists(shipped) else local


def _sweep(entry: Entry, name: str) -> Sweep:
    declarations = {each.name: each for each in FlightParameters.declarations()}
    if name not in declarations:
        raise entry.error(f"is not a parameter; expected one of {', '.join(declarations)}")
    declaration = declarations[name]
    kinds = entry.entries()
    if len(kinds) != 1 or next(iter(kinds)) not in (UNIFORM, NORMAL, VALUES):
        raise entry.error(f"has {shortened(', '.join(kinds)) or 'nothing'}; expected {_EXPECTED}")
    ((kind, content),) = kinds.items()
    elements = content.elements()
    if kind != VALUES and len(elements) != 2 or not elements:
        raise content.error(f"has {len(elements)} entries; expected {_EXPECTED}")
    numbers = [element.checked(declaration.type) for element in elements]
    if kind == UNIFORM and numbers[0] >= numbers[1]:
        raise content.error(f"is {numbers}; expected the lower number first")
    number: Any = declaration.type
    return Sweep(name, number.unit, kind, tuple(numbers), number.minimum, number.maximum)
