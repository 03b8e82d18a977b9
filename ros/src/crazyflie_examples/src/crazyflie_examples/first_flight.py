"""The protocol of a first flight: its steps, and the condition that each must meet before the next.

It does not use ROS: a `Rig` moves the vehicle and records it; a person answers.
"""

import html
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crazyflie_doctor.finding import ERROR, lines
from crazyflie_doctor.vehicle import checks
from crazyflie_model.angles import rotate_by_yaw, wrap_to_pi
from crazyflie_model.units import GRAVITY

Array = NDArray[np.float64]
Rig = Any  #: A `first_flight_program.LiveRig`, or one with the same methods.

HEIGHT = 0.3  #: Height of all hovers (m).
STEP = 0.3  #: Length of the steps along each axis (m).
TURN = 90.0  #: degrees.
CARRY = 1.0  #: Distance over which the vehicle is carried by hand, along each axis (m).
HIDDEN = 0.4  #: Duration of the loss of poses (s).
LOWEST_PWM = 8000  #: Command with which each motor is turned (PWM).

#: Largest relative error of the distance by hand; a person errs by 2 cm in 1 m.
MAX_SCALE_ERROR = 0.05
MAX_TURN_ERROR = 15.0  #: Largest error of the turn by hand (degrees).
MAX_DELAY = 0.06  #: Largest delay of poses behind the gyroscope (s).
MAX_ERROR = 0.1  #: Largest distance of a hover from its mean position (m).
MAX_OFFSET = 0.15  #: Largest distance of a hover's mean position from its goal (m).
#: Largest relative difference of one motor's command from the mean of the four.
MAX_IMBALANCE = 0.15
#: Mean thrust command over that of the model's hover: its mass, with a battery from full to half
#: empty.
HOVER_RANGE = (0.8, 1.2)
MIN_VOLTAGE = 3.2  #: Lowest voltage in flight (V).
FULL_PWM = 65000  #: Command from which a motor is saturated (PWM).
MAX_SATURATION = 0.02  #: Largest fraction of samples with a saturated motor.
MAX_LOSS_WAY = 0.3  #: Largest distance that the vehicle moves without poses (m).
MAX_TOUCHDOWN = 0.8  #: m/s.

#: Number of a motor -> its place and its direction, seen from above.
MOTORS = {
    1: ("front right", "counter-clockwise"),
    2: ("back right", "clockwise"),
    3: ("back left", "counter-clockwise"),
    4: ("front left", "clockwise"),
}


class Sample(NamedTuple):
    """A sample of a flight; motors, battery and gyroscope are those of the vehicle's log."""

    time: float  # s.
    x: float  # Position from the poses (m, fixed frame).
    y: float
    z: float
    yaw: float  # rad.
    gyro: float  # Yaw rate, rad/s.
    voltage: float  # V.
    motors: tuple[float, float, float, float]  # PWM.
    thrust: float = 0.0  # Commanded for all of them (PWM).


class Stop(Exception):  # noqa: N818
    """The protocol ends; the text names the fault."""


@dataclass(frozen=True)
class Verdict:
    """The result of a step."""

    step: str
    passed: bool
    text: str


@dataclass(frozen=True)
class Step:
    """A step: a line that explains it, and the function, which returns figures or raises `Stop`."""

    name: str
    explanation: str
    work: Callable[[Rig, Callable[[str], bool]], str]


def _columns(samples: Sequence[Sample]) -> tuple[Array, Array]:
    """Return times, shape (n,), and positions, shape (n, 3)."""
    if not samples:
        raise Stop("no poses have come; does motion capture see the vehicle?")
    table = np.array([sample[:4] for sample in samples], dtype=float)
    return table[:, 0], table[:, 1:]


def _since(rig: Rig, duration: float) -> list[Sample]:
    begin = len(rig.samples)
    rig.run(duration)
    return rig.samples[begin:]


# The steps.


def _doctor(rig, _):
    found = [each for check in checks(rig.examine()) for each in lines(check)]
    wrong = [line.removeprefix("error").strip() for level, line in found if level == ERROR]
    if wrong:
        raise Stop("; ".join(wrong))
    return "; ".join(line.split(maxsplit=1)[1] for _, line in found)


def _motors(rig, ask):
    for motor, (place, direction) in MOTORS.items():
        begin = len(rig.samples)
        rig.spin(motor, LOWEST_PWM)
        # All brushless motors of an armed vehicle turn, with a smaller command.
        turned = {
            i + 1
            for sample in rig.samples[begin:]
            for i, pwm in enumerate(sample.motors)
            if pwm >= LOWEST_PWM
        }
        if turned != {motor}:
            raise Stop(
                f"motor {motor} was commanded, and the vehicle's log shows {turned or 'none'}"
            )
        if not ask(f"Did motor {motor}, {place}, turn {direction}, seen from above?"):
            raise Stop(f"motor {motor} does not turn {direction} at its place, {place}")
    return "all four turn as they should"


def _hand(rig, _):
    """Compare poses with movements by hand."""
    rig.carry(0.0, 0.0, 0.0, 0.0)
    place, yaw = _rest(rig)
    ways = []
    for goal in np.eye(3) * CARRY:
        rig.carry(*goal, 0.0)
        moved, _ = _rest(rig)
        x, y, z = moved - place
        ways.append((*rotate_by_yaw(x, y, -yaw), z))
        rig.carry(0.0, 0.0, 0.0, 0.0)
    begin = len(rig.samples)
    rig.carry(0.0, 0.0, 0.0, TURN)
    _, turned = _rest(rig)
    turn = rig.samples[begin:]
    rig.carry(0.0, 0.0, 0.0, 0.0)
    _check_axes(np.array(ways).T / CARRY)
    angle = math.degrees(wrap_to_pi(turned - yaw))
    if abs(angle - TURN) > MAX_TURN_ERROR:
        raise Stop(f"a turn by {TURN:g} degrees to the left is {angle:.0f} degrees in the poses")
    delay = pose_delay(turn)
    if delay > MAX_DELAY:
        raise Stop(
            f"poses are delayed: {1000.0 * delay:.0f} ms behind the gyroscope, expected at most "
            f"{1000.0 * MAX_DELAY:.0f} ms"
        )
    return f"axes and scale are right; poses are {1000.0 * delay:.0f} ms behind the gyroscope"


def _rest(rig):
    """Return mean position (m) and heading (rad) of a vehicle at rest."""
    rig.run(0.5)
    samples = _since(rig, 0.5)
    _, places = _columns(samples)
    return places.mean(axis=0), samples[-1].yaw


def _check_axes(measured: Array) -> None:
    """Raise `Stop` unless a matrix is near the identity.

    Its columns are the measured displacements forward, left and up, divided by the true ones.
    """
    lengths = np.linalg.norm(measured, axis=0)
    if not (lengths > 0.2).all():
        raise Stop("poses do not follow the movement by hand: is this the tracked vehicle?")
    directions = measured / lengths
    nearest = np.rint(directions)
    names = np.array(["forward", "left", "up"])
    if np.linalg.norm(directions - nearest) > 0.4:
        turned = math.degrees(math.atan2(directions[1, 0], directions[0, 0]))
        raise Stop(f"the yaw is off: forward is at {turned:.0f} degrees in the poses' heading")
    if not (nearest == np.eye(3)).all():
        if np.linalg.det(nearest) > 0.0 and nearest[2, 2] == 1.0:
            turned = math.degrees(math.atan2(nearest[1, 0], nearest[0, 0]))
            raise Stop(
                f"the yaw is off by {-turned:.0f} degrees: forward by hand is at {turned:.0f} "
                "degrees in the heading of the poses; align the rigid body"
            )
        seen = [
            f"{name} by hand is {'minus ' if column.sum() < 0.0 else ''}"
            f"{names[np.abs(column).argmax()]} in the poses"
            for name, column in zip(names, nearest.T, strict=True)
            if column[list(names).index(name)] != 1.0
        ]
        raise Stop(f"axes are swapped: {', '.join(seen)}")
    if (np.abs(lengths - 1.0) > MAX_SCALE_ERROR).any():
        scale = ", ".join(f"{each:.2f}" for each in lengths)
        raise Stop(
            f"the scale is wrong: {CARRY:g} m by hand are {scale} m in the poses (forward, left, "
            "up); calibrate motion capture again"
        )


def pose_delay(samples: Sequence[Sample]) -> float:
    """Return the delay of the poses' heading behind the gyroscope's integral, s.

    It is the shift between 0 and 0.3 s for which the two differ least in a turn.
    """
    times, _ = _columns(samples)
    yaw = np.unwrap([sample.yaw for sample in samples])
    steps = np.diff(times, prepend=times[0])
    rates = np.array([sample.gyro for sample in samples])
    integral = np.cumsum(0.5 * (rates + np.roll(rates, 1)) * steps)
    shifts = np.arange(0.0, 0.3, 0.005)

    def difference(shift):
        error = np.interp(times - shift, times, integral) - yaw
        return float(np.std(error))

    return float(shifts[np.argmin([difference(shift) for shift in shifts])])


def _hover_pwm(samples):
    return float(np.mean([sample.thrust for sample in samples]))


def _in_flight(samples, goal, model):
    """Check a hover; return its figures in words."""
    _, places = _columns(samples)
    motors = np.array([sample.motors for sample in samples])
    means = motors.mean(axis=0)
    imbalance = means / means.mean() - 1.0
    worst = int(np.abs(imbalance).argmax())
    if abs(imbalance[worst]) > MAX_IMBALANCE:
        raise Stop(
            f"motor {worst + 1} is commanded {100 * imbalance[worst]:+.0f} % against the others, "
            f"expected within {100 * MAX_IMBALANCE:.0f} %: the motor is weak, or the centre of "
            "mass is off; change its propeller, then the motor"
        )
    load = _hover_pwm(samples) / model.pwm(GRAVITY)
    if not HOVER_RANGE[0] <= load <= HOVER_RANGE[1]:
        raise Stop(
            f"the mass is off: hover takes {100 * load:.0f} % of the model's thrust, expected "
            f"{100 * HOVER_RANGE[0]:.0f} to {100 * HOVER_RANGE[1]:.0f} %: weigh the vehicle, and "
            "choose its --model, or identify it"
        )
    voltage = min(sample.voltage for sample in samples)
    if voltage < MIN_VOLTAGE:
        raise Stop(f"the battery sags to {voltage:.2f} V, expected {MIN_VOLTAGE:g} V or more")
    saturated = float((motors >= FULL_PWM).any(axis=1).mean())
    if saturated > MAX_SATURATION:
        raise Stop(f"a motor is saturated for {100 * saturated:.0f} % of the time")
    offset = float(np.linalg.norm(places.mean(axis=0) - goal))
    if offset > MAX_OFFSET:
        raise Stop(
            f"the vehicle is {offset:.2f} m from its goal, expected at most {MAX_OFFSET:g} m"
        )
    spread = float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())
    if spread > MAX_ERROR:
        raise Stop(f"the vehicle oscillates by {spread:.2f} m, expected at most {MAX_ERROR:g} m")
    return (
        f"within {100 * spread:.0f} cm, {100 * offset:.0f} cm off; thrust {100 * load:.0f} % of "
        f"the model's; {voltage:.2f} V"
    )


def _driver_hover(rig, _):
    place, _ = _rest(rig)
    rig.driver_takeoff(HEIGHT)
    rig.run(2.0)
    samples = _since(rig, 5.0)
    # By its own estimate, the vehicle hovers near its start.
    text = _in_flight(samples, place + (0.0, 0.0, HEIGHT), rig.model)
    return f"{text}; {rig.note_hover(_hover_pwm(samples))}"


def _yaw(rig, _):
    before = rig.samples[-1]
    rig.driver_turn(TURN)
    rig.run(3.0)
    angle = math.degrees(wrap_to_pi(rig.samples[-1].yaw - before.yaw))
    if abs(angle - TURN) > MAX_TURN_ERROR:
        raise Stop(f"the vehicle has turned by {angle:.0f} degrees, expected {TURN:g}")
    rig.driver_turn(-TURN)
    rig.run(3.0)
    text = _in_flight(_since(rig, 2.0), before[1:4], rig.model)
    rig.driver_land()
    return f"turns by {angle:.0f} degrees and back; {text}"


def _lqr_hover(rig, _):
    rig.take_off()
    rig.run(3.0)
    return _in_flight(_since(rig, 5.0), (0.0, 0.0, HEIGHT), rig.model)


def _steps(rig, _):
    texts = []
    for goal in ((STEP, 0.0, HEIGHT), (0.0, STEP, HEIGHT), (0.0, 0.0, HEIGHT + STEP)):
        for point in (goal, (0.0, 0.0, HEIGHT)):
            rig.refer(*point)
            rig.run(5.0)
            texts.append(_in_flight(_since(rig, 1.0), point, rig.model))
    return f"along all axes and back; {texts[-1]}"


def _loss(rig, _):
    before = np.array(rig.samples[-1][1:4])
    rig.hide_poses(HIDDEN)
    moved = float(np.linalg.norm(np.array(rig.samples[-1][1:4]) - before))
    rig.run(0.2)
    moved = max(moved, float(np.linalg.norm(np.array(rig.samples[-1][1:4]) - before)))
    if moved > MAX_LOSS_WAY:
        raise Stop(
            f"the vehicle moves by {moved:.2f} m without poses, expected at most {MAX_LOSS_WAY:g} m"
        )
    rig.run(3.0)
    text = _in_flight(_since(rig, 1.0), (0.0, 0.0, HEIGHT), rig.model)
    return f"moves by {100 * moved:.0f} cm; {text}"


def _land(rig, _):
    begin = len(rig.samples)
    rig.land()
    times, places = _columns(rig.samples[begin:])
    speeds = -np.gradient(places[:, 2], times) if len(times) > 2 else np.zeros(1)
    fastest = float(np.convolve(speeds, np.full(5, 0.2), "valid").max())
    if places[-1, 2] > 0.08:
        raise Stop(f"the vehicle is at a height of {places[-1, 2]:.2f} m after the landing")
    if fastest > MAX_TOUCHDOWN:
        raise Stop(
            f"the vehicle has sunk at {fastest:.2f} m/s, expected at most {MAX_TOUCHDOWN:g} m/s"
        )
    return f"sinks at {fastest:.2f} m/s at most"


def _emergency(rig, _):
    rig.emergency()
    rig.run(0.5)
    if any(rig.samples[-1].motors):
        raise Stop("motors turn after the emergency stop")
    return "the motors stand still; restart the vehicle before it flies again"


STEPS = (
    Step("doctor", "battery, link, decks and firmware are checked", _doctor),
    Step(
        "motors",
        "take the propellers off, or hold the vehicle: each motor turns at the lowest thrust",
        _motors,
    ),
    Step("poses by hand", "you carry the vehicle forward, left and up, and turn it left", _hand),
    Step("hover by the driver", f"it takes off to {HEIGHT:g} m and hovers for 5 s", _driver_hover),
    Step("yaw", f"it turns by {TURN:g} degrees and back, and lands", _yaw),
    Step("hover by the LQR", "the same with this workspace's controller", _lqr_hover),
    Step("steps", f"{STEP:g} m along each axis, and back", _steps),
    Step("loss of poses", f"no poses come for {HIDDEN:g} s", _loss),
    Step("landing", "it lands", _land),
    Step("emergency", "on the ground, the emergency stop is latched", _emergency),
)


def fly(rig: Rig, ask: Callable[[str], bool]) -> Iterator[Verdict]:
    """Do the steps one after the other and yield their verdicts; stop after the first failure.

    ``ask(text)`` asks a person, and returns whether the answer is yes; every step begins with it.
    """
    for step in STEPS:
        try:
            if not ask(f"{step.name}: {step.explanation}"):
                raise Stop("ended by the pilot")
            text = step.work(rig, ask)
        except Stop as reason:
            yield Verdict(step.name, False, str(reason))
            return
        yield Verdict(step.name, True, text)


def report(verdicts: Sequence[Verdict], title: str, bag: str) -> str:
    """Return a report as HTML: a verdict for each step, the remaining steps, and the bag."""
    done = {verdict.step: verdict for verdict in verdicts}
    rows = []
    for step in STEPS:
        verdict = done.get(step.name)
        word = "not done" if verdict is None else "passed" if verdict.passed else "FAILED"
        cells = (step.name, word, "" if verdict is None else verdict.text)
        rows.append("".join(f"<td>{html.escape(cell)}</td>" for cell in cells))
    table = "".join(f"<tr>{row}</tr>" for row in rows)
    return (
        '<!doctype html><meta charset="utf-8">'
        f"<title>{html.escape(title)}</title>"
        "<style>body{font-family:sans-serif;margin:2em}td{padding:.3em 1em;vertical-align:top}"
        "tr:nth-child(odd){background:#eee}</style>"
        f"<h1>{html.escape(title)}</h1><table>{table}</table>"
        f"<p>Recording: <code>{html.escape(bag)}</code>; "
        "<code>rosrun crazyflie_reports flight_report</code> makes its plots.</p>"
    )
