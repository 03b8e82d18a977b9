"""Checks of one vehicle on the ground: battery, link, decks, firmware, estimate, self tests.

Normal ranges are those of a Crazyflie 2.1 with the stock battery; figures of a vehicle at rest.
"""

import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from crazyflie_doctor.finding import Check, Finding, error, warn
from crazyflie_doctor.graph import COMPLEMENTARY
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.errors import CrazyflieError
from crazyflie_link.log import LogBlock
from crazyflie_model.supervisor import SupervisorState

#: Lowest voltage for a flight of some minutes, and highest voltage of one cell (V).
MIN_VOLTAGE, FULL_VOLTAGE = 3.7, 4.25
MIN_QUALITY = 0.95  #: Share of answered pings.
MAX_LATENCY = 0.02  #: 95th percentile of the round-trip time, s.
#: Deviation of the estimated velocity, m/s, and its change while the vehicle is watched.
MAX_DEVIATION, MAX_CHANGE = 0.1, 0.03
#: Releases of the firmware that this workspace was flown against.
KNOWN_FIRMWARE = ("2026.08",)
ALL_MOTORS = 0b1111  #: Bit mask in health.motorPass.

_ESTIMATOR = "stabilizer.estimator"  #: Parameter with the number of the estimator.

_PERIOD_MS = 100
_SELF_TEST_LIMIT = 10.0  #: s.
#: Port, channel and first byte of the question for the firmware's version, and of its answer.
_VERSION = (13, 1, b"\x01")
#: Blocks of the log that are recorded, as far as the firmware has their variables.
_BLOCKS = {
    "battery": ("pm.vbat",),
    "variances": ("kalman.varPX", "kalman.varPY", "kalman.varPZ"),
    "health": ("health.motorPass", "health.batteryPass", "health.motorTestCount"),
}


@dataclass
class VehicleFacts:
    """Facts about a vehicle that stands on the ground; None or NaN for what is not known."""

    voltage: float = math.nan  # V.
    quality: float = math.nan  # Share of answered pings.
    latency: float = math.nan  # s.
    decks: tuple[str, ...] = ()  # Such as bcFlow2.
    firmware: str = ""  # Release.
    state: SupervisorState | None = None  # None: firmware that does not report it.
    # Standard deviations of the estimated velocity along each axis (m/s).
    deviations: tuple[float, ...] = ()
    estimator: float | None = None  # Number of the firmware's estimator.
    changes: tuple[float, ...] = ()  # Changes of these while the vehicle was watched (m/s).
    motors: int | None = None  # Bit mask of those that have passed their test; None: not tested.
    battery_passed: bool | None = None  # None: not tested.
    failure: str = ""  # Reason why nothing is known.


def checks(facts: VehicleFacts) -> Iterator[Check]:
    """Yield the checks of a vehicle."""
    if facts.failure:
        yield Check("vehicle", "", [error(facts.failure, "correct this first")])
        return
    yield Check("battery", f"{facts.voltage:.2f} V", _battery(facts))
    yield Check(
        "link",
        f"{100.0 * facts.quality:.0f} % of pings answered, latency {1000.0 * facts.latency:.1f} ms",
        _link(facts),
    )
    yield Check("decks", ", ".join(facts.decks) or "none", [])
    yield Check("firmware", facts.firmware, _firmware(facts))
    words = "unknown" if facts.state is None else facts.state.words()
    yield Check("state", words, _state(facts))
    deviations = ", ".join(f"{each:.3f}" for each in facts.deviations)
    yield Check("estimate", f"velocity within {deviations} m/s, at rest", _estimate(facts))
    yield Check("motors", _tested(facts.motors, "all four pass"), _motors(facts))
    yield Check("battery test", _tested(facts.battery_passed, "passes"), _battery_test(facts))


def _tested(result, text):
    return "not tested; --motors true does, and turns the propellers" if result is None else text


def _battery(facts: VehicleFacts) -> Iterator[Finding]:
    if not MIN_VOLTAGE <= facts.voltage <= FULL_VOLTAGE:
        yield error(
            f"{facts.voltage:.2f} V without load; normal is {MIN_VOLTAGE} to {FULL_VOLTAGE} V",
            "charge the battery; if it is full, change it",
        )


def _link(facts: VehicleFacts) -> Iterator[Finding]:
    remedy = "come nearer, turn the antenna, take another channel: wireless networks disturb"
    if not facts.quality >= MIN_QUALITY:
        yield error(
            f"{100.0 * facts.quality:.0f} % of pings answered; normal is {100 * MIN_QUALITY:.0f} % "
            "or more",
            remedy,
        )
    if not facts.latency <= MAX_LATENCY:
        yield warn(
            f"latency {1000.0 * facts.latency:.1f} ms; normal is {1000 * MAX_LATENCY:.0f} ms or "
            "less",
            remedy,
        )


def _firmware(facts: VehicleFacts) -> Iterator[Finding]:
    if not facts.firmware.startswith(KNOWN_FIRMWARE):
        yield warn(
            f"release {facts.firmware or 'unknown'}; flown against {', '.join(KNOWN_FIRMWARE)}",
            "update it with cfclient, or watch the first flights",
        )


def _state(facts: VehicleFacts) -> Iterator[Finding]:
    if facts.state is not None and facts.state.faults:
        yield error(f"the vehicle cannot fly: {facts.state.faults.words()}", facts.state.remedy)


def _estimate(facts: VehicleFacts) -> Iterator[Finding]:
    if facts.estimator == COMPLEMENTARY:
        yield error(
            "the complementary filter estimates, which ignores poses from motion capture and knows "
            "no position; normal is the Kalman filter",
            f"set {_ESTIMATOR} to 2, by the launch file or update_params; a flight on attitude and "
            "thrust alone does not need it",
        )
        return
    if not facts.deviations:
        yield warn("its variance is not logged", "set stabilizer.estimator to 2, or update")
        return
    # NaN is not within any limit.
    if not all(each <= MAX_DEVIATION for each in facts.deviations):
        yield error(
            f"velocity with a deviation of {max(facts.deviations):.2f} m/s at rest; normal is "
            f"{MAX_DEVIATION:g} m/s or less",
            "let it see its positioning system, or send it poses; leave it at rest and try again",
        )
    elif not all(each <= MAX_CHANGE for each in facts.changes):
        yield error(
            f"the deviation of the velocity has changed by {max(facts.changes):.2f} m/s; normal is "
            f"{MAX_CHANGE:g} m/s or less at rest",
            "leave it at rest until it has converged",
        )


def _motors(facts: VehicleFacts) -> Iterator[Finding]:
    if facts.motors is not None and facts.motors != ALL_MOTORS:
        failed = [str(i + 1) for i in range(4) if not facts.motors >> i & 1]
        yield error(
            f"motor {', '.join(failed)} fails its self test; normal is that all four pass",
            "look for hair and bent propellers, push the motor fully into its mount, change "
            "propeller or motor",
        )


def _battery_test(facts: VehicleFacts) -> Iterator[Finding]:
    if facts.battery_passed is False:
        yield error("its voltage sags too far under load", "change the battery, clean its contacts")


def examine(
    uri: str,
    duration: float = 10.0,
    motors: bool = False,
    prepare: Callable[[Crazyflie], None] = lambda _: None,
) -> VehicleFacts:
    """Connect to a vehicle and watch it for a duration (s); blocks.

    With ``motors`` it does the self tests, in which the propellers turn. ``prepare(vehicle)`` is
    called before.
    """
    versions: list[bytes] = []

    def on_packet(port: int, channel: int, data: bytes) -> None:
        if (port, channel, data[:1]) == _VERSION:
            versions.append(data[1:].split(b"\0")[0])

    try:
        with Crazyflie(uri, on_packet=on_packet) as vehicle:
            prepare(vehicle)
            return _watch(vehicle, versions, duration, motors)
    except CrazyflieError as failure:
        return VehicleFacts(failure=str(failure))


def _watch(
    vehicle: Crazyflie, versions: list[bytes], duration: float, motors: bool
) -> VehicleFacts:
    known = vehicle.log.variables()
    # The link's thread adds rows.
    rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in _BLOCKS}
    for name, variables in _BLOCKS.items():
        if all(each in known for each in variables):
            on_values = partial(lambda own, _, values: own.append(tuple(values)), rows[name])
            vehicle.add_log_block(LogBlock(name, _PERIOD_MS, variables, on_values))
    vehicle.send_packet(*_VERSION)
    end = time.monotonic() + duration
    while time.monotonic() < end:
        # Raises the reason when the link is lost.
        vehicle.link()
        time.sleep(_PERIOD_MS / 1000.0)
    decks = [name.partition(".") for name, value in vehicle.parameters.values().items() if value]
    voltages = [voltage for (voltage,) in rows["battery"]]
    deviations = [tuple(map(_root, sample)) for sample in rows["variances"]]
    facts = VehicleFacts(
        voltage=statistics.fmean(voltages) if voltages else math.nan,
        quality=vehicle.quality(),
        latency=vehicle.latency(),
        decks=tuple(sorted(name for prefix, _, name in decks if prefix == "deck")),
        firmware=versions[-1].decode(errors="replace") if versions else "",
        state=vehicle.supervisor.read(),
        estimator=vehicle.parameters.known(_ESTIMATOR),
        deviations=deviations[-1] if deviations else (),
        changes=tuple(max(axis) - min(axis) for axis in zip(*deviations, strict=True)),
    )
    if motors and rows["health"]:
        facts.motors = int(_self_test(vehicle, rows["health"], "health.startPropTest")[0])
        facts.battery_passed = bool(_self_test(vehicle, rows["health"], "health.startBatTest")[1])
    return facts


def _self_test(vehicle, health, parameter):
    """Start a self test and return the health that follows it."""
    before = health[-1][2]
    vehicle.parameters.write(parameter, 1)
    end = time.monotonic() + _SELF_TEST_LIMIT
    while health[-1][2] == before and time.monotonic() < end:
        time.sleep(_PERIOD_MS / 1000.0)
    return health[-1]


def _root(variance):
    return math.sqrt(variance) if variance >= 0.0 else math.nan
