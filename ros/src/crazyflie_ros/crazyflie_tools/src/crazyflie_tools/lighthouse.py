"""The tool `lighthouse`: the geometry of base stations is measured, stored and checked."""

import itertools
import queue
from pathlib import Path
from typing import Any

import numpy as np
from cflib.crazyflie.mem import LighthouseBsGeometry
from cflib.localization import (
    LhDeck4SensorPositions,
    LighthouseConfigFileManager,
    LighthouseCrossingBeam,
    LighthouseGeometrySolution,
    Pose,
)
from cflib.localization.lighthouse_bs_vector import LighthouseBsVectors
from cflib.localization.lighthouse_cf_pose_sample import LhCfPoseSample
from cflib.localization.lighthouse_geo_estimation_manager import (
    LhGeoEstimationManager,
    LhGeoInputContainer,
)
from cflib.localization.lighthouse_system_scaler import LighthouseSystemScaler
from cflib.localization.lighthouse_types import LhException

import crazyflie_link
from crazyflie_link.errors import NoAnswerError, NoReplyError, RefusedError, ValueRangeError
from crazyflie_tools.program import make_parser, run
from crazyflie_utils.text_file import user_path

#: Largest distance between the rays of two base stations to one sensor (m): cflib's limit.
MAX_RESIDUAL = 0.01
#: Largest error of the vehicle's own estimate (m).
MAX_POSITION_ERROR = 0.05
#: Largest error of the distance from the origin to the x axis' position, as a fraction: that
#: distance, by the size of the deck, is known to a few percent.
MAX_SCALE_ERROR = 0.1
#: Largest height of a position on the floor over the plane through all of them (m).
MAX_HEIGHT = 0.02
#: Least distance of the farthest position from the x axis (m): the floor's tilt follows from it.
MIN_DISTANCE = 0.3

_DECK = "deck.bcLighthouse4"
_ESTIMATE = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z")
_READINGS, _SETTLED, _ATTEMPTS = 50, 0.005, 10  #: Number, largest deviation (m), number.
_READING_LIMIT = 1.0  #: Time limit of a reading (s).
_SENSORS = LhDeck4SensorPositions.positions

_POSITIONS = (
    "at the origin, its front in the direction of x",
    f"{LhGeoEstimationManager.REFERENCE_DIST:.2f} m from the origin on the positive x axis",
    f"elsewhere on the floor, more than {MIN_DISTANCE:g} m from the x axis",
)
_FURTHER = "at a further position on the floor; five in all, or more, are good"

Vector = np.ndarray[Any, np.dtype[np.float64]]


def lighthouse(arguments: list[str] | None = None) -> int:
    """Measure, store and check the geometry of Lighthouse base stations."""
    parser = make_parser(
        "lighthouse",
        "Measure the geometry of Lighthouse base stations: the vehicle is put on the floor at the "
        "origin, 1 m from it on the x axis, and at one or more further positions, asked for one at "
        "a time. The geometry is stored in a file and in the vehicle, and checked.",
        has_timeout=False,
    )
    parser.add_argument(
        "--out",
        type=user_path,
        default=Path("lighthouse.yaml"),
        metavar="FILE",
        help="file for the measured geometry, as cfclient writes it; by default %(default)s",
    )
    modes = parser.add_mutually_exclusive_group()
    modes.add_argument("--file", metavar="FILE", help="store the geometry of this file instead")
    modes.add_argument(
        "--check", action="store_true", help="only check the geometry that the vehicle has"
    )
    options = parser.parse_args(arguments)

    def work() -> None:
        if not (options.file or options.check) and options.out.exists():
            raise ValueRangeError(f"--out is {options.out}, which exists; expected a new file")
        with crazyflie_link.Crazyflie(options.uri.uri) as vehicle:
            if options.file:
                number = vehicle.lighthouse.write_file(options.file, vehicle.parameters)
                print(f"{options.file}: {number} base stations stored in the vehicle")
                return
            if not vehicle.parameters.values().get(_DECK):
                raise RefusedError(f"the vehicle has no Lighthouse deck: {_DECK} is not 1")
            if options.check:
                check(vehicle)
            else:
                measure(vehicle, options.out)

    return run(parser.prog, work, None)


def measure(vehicle: crazyflie_link.Crazyflie, path: Path) -> None:
    """Ask for positions, calculate the geometry, store it in a new file and in the vehicle, check.

    Raises `CrazyflieError` if the geometry cannot be calculated, or is not good; nothing is stored
    then.
    """
    samples: list[dict[int, LighthouseBsVectors]] = []
    for place in itertools.chain(_POSITIONS, itertools.repeat(_FURTHER)):
        if not _asks(f"{len(samples) + 1}. Put the vehicle {place}.", "q calculates"):
            break
        samples.append(_seen(vehicle, 2))
        print("   base stations " + ", ".join(map(str, samples[-1])))
    geometries, figures = solve(samples)
    _, calibrations = vehicle.lighthouse.read()
    for number, geometry in sorted(geometries.items()):
        print(f"base station {number} at ({_text(geometry.origin)}) m")
    print(figures)
    LighthouseConfigFileManager.write(str(path), geometries, calibrations)
    vehicle.lighthouse.write_file(str(path), vehicle.parameters)
    print(f"stored in the vehicle and in {path}")
    if not _asks("Put the vehicle at the origin again.", "q leaves the geometry unchecked"):
        return
    _check_position(_estimate(vehicle), np.zeros(3))


def solve(
    samples: list[dict[int, LighthouseBsVectors]],
) -> tuple[dict[int, LighthouseBsGeometry], str]:
    """Return the geometry from the angles at each position, and its quality in words.

    The first position is the origin, the second on the x axis, the others on the floor. Raises
    `ValueRangeError` if the positions are too few, or inconsistent.
    """
    if len(samples) < len(_POSITIONS):
        raise ValueRangeError(
            f"measured at {len(samples)} positions; expected at least {len(_POSITIONS)}: the "
            "origin, one on the x axis, one elsewhere on the floor. Nothing is stored"
        )
    origin, x_axis, *floor = map(LhCfPoseSample, samples)
    container = LhGeoInputContainer(_SENSORS)
    container.set_origin_sample(origin)
    container.set_x_axis_sample(x_axis)
    container.set_xy_plane_samples(floor)
    try:
        solution = LhGeoEstimationManager.estimate_geometry(container.get_data_copy())
    except (LhException, np.linalg.LinAlgError, ValueError, IndexError) as error:
        raise ValueRangeError(f"no geometry fits: {error}. Nothing is stored") from None
    figures = _judged(solution)
    return {number: _geometry(pose) for number, pose in solution.bs_poses.items()}, figures


def _judged(solution: LighthouseGeometrySolution) -> str:
    # Returns the figures of a good solution.
    if not (solution.progress_is_ok and solution.has_converged):
        reasons = (
            solution.general_failure_info,
            solution.origin_sample_info and f"origin: {solution.origin_sample_info}",
            solution.x_axis_samples_info and f"x axis: {solution.x_axis_samples_info}",
            solution.xy_plane_samples_info and f"floor: {solution.xy_plane_samples_info}",
        )
        reason = "; ".join(filter(None, reasons)) or "not converged"
        raise ValueRangeError(f"no geometry fits: {reason}. Nothing is stored")
    places = np.array([sample.pose.translation for sample in solution.samples])
    worst = max(solution.samples, key=lambda sample: sample.error_distance)
    residual = worst.error_distance
    height = np.abs(places[:, 2]).max()
    # Scaled as if the size of the deck were known, not the distance on the x axis.
    poses = [sample.pose for sample in solution.samples]
    *_, scale = LighthouseSystemScaler.scale_diagonals(
        solution.bs_poses, poses, solution.samples, float(np.linalg.norm(_SENSORS[3] - _SENSORS[0]))
    )
    figures = (
        f"residual {1000.0 * residual:.1f} mm (at most {1000.0 * MAX_RESIDUAL:g}), distance on the "
        f"x axis by the size of the deck {scale:.2f} m, largest height on the floor "
        f"{1000.0 * height:.1f} mm"
    )
    if residual > MAX_RESIDUAL:
        problem = (
            f"residual {1000.0 * residual:.1f} mm, at position "
            f"{solution.samples.index(worst) + 1}; expected at most {1000.0 * MAX_RESIDUAL:g}: was "
            "the vehicle moved, or the light reflected?"
        )
    elif abs(scale - 1.0) > MAX_SCALE_ERROR:
        problem = (
            f"position 2 is {scale:.2f} m from the origin by the size of the deck; expected "
            f"{LhGeoEstimationManager.REFERENCE_DIST:.2f}"
        )
    elif (farthest := np.abs(places[2:, 1]).max()) < MIN_DISTANCE:
        problem = (
            f"all positions are within {farthest:.2f} m of the x axis; expected one at "
            f"{MIN_DISTANCE:g} m or more"
        )
    elif height > MAX_HEIGHT:
        problem = f"a position is {height:.3f} m off the floor; expected at most {MAX_HEIGHT}"
    else:
        return figures
    raise ValueRangeError(f"{problem}. Nothing is stored")


def check(vehicle: crazyflie_link.Crazyflie) -> None:
    """Check the vehicle's geometry at its position: the residual of its rays, and its own estimate.

    Raises `CrazyflieError` if it has no geometry, sees no base station of it, or one of both is
    wrong.
    """
    geometries, _ = vehicle.lighthouse.read()
    if not geometries:
        raise RefusedError(
            "the vehicle has no geometry of a base station; expected at least one: measure it, "
            "or store one with --file"
        )
    rays = []
    for number, vectors in _seen(vehicle, 1).items():
        geometry = geometries.get(number)
        text = f"at ({_text(geometry.origin)}) m" if geometry else "seen, without geometry"
        print(f"base station {number} {text}")
        if geometry:
            rays.append((Pose(geometry.rotation_matrix, geometry.origin), vectors))
    if not rays:
        raise RefusedError(f"geometry of base stations {_numbers(geometries)}; none is seen")
    if len(rays) == 1:
        estimate = _estimate(vehicle)
        print(f"estimate ({_text(estimate)}) m; not checked, which requires two base stations")
        return
    position, residual = LighthouseCrossingBeam.position_max_distance_all_permutations(rays)
    print(f"residual {1000.0 * residual:.1f} mm (at most {1000.0 * MAX_RESIDUAL:g})")
    if residual > MAX_RESIDUAL:
        raise RefusedError(
            f"residual {1000.0 * residual:.1f} mm; expected at most {1000.0 * MAX_RESIDUAL:g}: has "
            "a base station been moved? Measure the geometry again"
        )
    # Asked last: with a base station that was moved the estimate does not come to rest.
    _check_position(_estimate(vehicle), position)


def _check_position(estimate, expected):
    error = float(np.linalg.norm(estimate - expected))
    text = f"estimate ({_text(estimate)}) m, {1000.0 * error:.0f} mm from ({_text(expected)})"
    if error > MAX_POSITION_ERROR:
        raise RefusedError(f"{text}; expected at most {1000.0 * MAX_POSITION_ERROR:g} mm")
    print(text)


def _seen(vehicle, fewest):
    angles = vehicle.lighthouse.angles()
    if not angles:
        raise NoAnswerError(
            f"no base station seen; expected {fewest} or more: are they on, in sight of the deck, "
            "and of the type in lighthouse.systemType?"
        )
    if len(angles) < fewest:
        raise NoAnswerError(
            f"only base station {_numbers(angles)} seen; expected {fewest} or more at each "
            "position. Nothing is stored"
        )
    return angles


def _estimate(vehicle: crazyflie_link.Crazyflie) -> Vector:
    # Returns the mean of the vehicle's estimate at rest; earlier estimates are forgotten.
    readings: queue.SimpleQueue[tuple[float, ...]] = queue.SimpleQueue()
    if "kalman.resetEstimation" in vehicle.parameters.types():
        vehicle.parameters.write("kalman.resetEstimation", 1)
        vehicle.parameters.write("kalman.resetEstimation", 0)
    vehicle.add_log_block(
        crazyflie_link.LogBlock("estimate", 20, _ESTIMATE, lambda _, values: readings.put(values))
    )
    for _ in range(_ATTEMPTS):
        try:
            latest = np.array([readings.get(timeout=_READING_LIMIT) for _ in range(_READINGS)])
        except queue.Empty:
            raise NoReplyError(f"no estimate within {_READING_LIMIT:g} s") from None
        if latest.std(axis=0).max() < _SETTLED:
            return latest.mean(axis=0)
    deviation = 1000.0 * latest.std(axis=0).max()
    raise RefusedError(
        f"the estimate has a deviation of {deviation:.0f} mm at rest; expected less than "
        f"{1000.0 * _SETTLED:g}"
    )


def _geometry(pose):
    geometry = LighthouseBsGeometry()
    geometry.origin = pose.translation.tolist()
    geometry.rotation_matrix = pose.rot_matrix.tolist()
    geometry.valid = True
    return geometry


def _asks(text, otherwise):
    # Whether Enter was pressed.
    try:
        return input(f"{text} Enter measures, {otherwise}: ").strip() != "q"
    except EOFError:
        print()
        return False


def _text(vector):
    return ", ".join(f"{part:.3f}" for part in vector)


def _numbers(stations):
    return ", ".join(map(str, sorted(stations)))
