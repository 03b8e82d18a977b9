"""Why a takeoff is refused, and what ends a flight for the server."""

import enum
import math
from collections.abc import Callable

from crazyflie_takeoff.envelope import Box, hover_complaint
from crazyflie_takeoff.guards import MAX_FAULT_TIME, TILTED, Guard
from crazyflie_takeoff.motion import TOUCHDOWN_HEIGHT, Measured
from crazyflie_takeoff.phases import FilterState
from crazyflie_takeoff.server_parameters import TakeoffServerParameters
from crazyflie_takeoff.server_table import (
    AIRBORNE,
    FLYING,
    OPEN_LOOP,
    FilterReport,
    Request,
)
from crazyflie_takeoff.vehicle_facts import VehicleFacts

POSITIONING_PATIENCE = (
    0.3  #: Time for which the vehicle's positioning is wrong before a landing (s).
)
MAX_VOLTAGE_AGE = 5.0  #: Age at which a voltage is unknown (s); the driver sends one a second.
_LONGEST_STEP = 1.5  #: Longest time between two voltages that is added to a duration (s).
_NOT_LOWER = -math.inf  # Duration below a level of a voltage that is not below it (s).
_NO_CONTROLLER = "no commanded controls come; is the controller running?"


class Charge(enum.Enum):
    """Charge of a battery."""

    UNKNOWN = enum.auto()
    GOOD = enum.auto()
    LOW = enum.auto()
    CRITICAL = enum.auto()


class BatteryCheck:
    """The charge of a battery, from the time for which its voltage has been below two levels (V).

    In flight the voltage sags with every burst of thrust. So it must stay low for ``duration``
    (s); if that is 0, a single low voltage is enough.
    """

    def __init__(self, low: float, critical: float, duration: float):
        self._levels = (critical, low)
        self._duration = duration
        self._lasted = [_NOT_LOWER, _NOT_LOWER]
        self.voltage = math.nan
        self._time = math.inf  # s; infinite before the first voltage.

    def measure(self, time: float, voltage: float) -> None:
        """Record a voltage (V) that was measured at ``time`` (s)."""
        step = min(max(time - self._time, 0.0), _LONGEST_STEP)
        self._lasted = [
            max(lasted + step, 0.0) if voltage < level else _NOT_LOWER
            for lasted, level in zip(self._lasted, self._levels, strict=True)
        ]
        self.voltage, self._time = voltage, time

    def charge(self, time: float) -> Charge:
        """Return the charge at ``time`` (s)."""
        if not abs(time - self._time) < MAX_VOLTAGE_AGE:
            return Charge.UNKNOWN
        critical, low = (lasted >= self._duration for lasted in self._lasted)
        if critical:
            return Charge.CRITICAL
        return Charge.LOW if low else Charge.GOOD


class TakeoffChecks:
    """Facts about estimator, controller, driver, battery and geofence, and refusals by them.

    ``resolve(topic)`` returns the absolute name of a topic. ``parameters`` may be replaced by
    others of the same topics.
    """

    def __init__(self, parameters: TakeoffServerParameters, resolve: Callable[[str], str]):
        self.parameters = parameters
        self.box = parameters.box
        self.measured = Measured()
        self.is_tilted = False
        #: What the driver publishes about the vehicle.
        self.vehicle = VehicleFacts(parameters.connected_topic, resolve)
        self.battery = BatteryCheck(
            parameters.battery_low, parameters.battery_critical, parameters.battery_duration
        )
        # The filter publishes it, and there may be no filter.
        self.has_controller = True
        self._had_controller = False
        topic = parameters.inhibition_topic
        # Reason for which another node refuses takeoffs; empty if it does not.
        self.inhibition = "" if topic is None else f"nothing has come on {resolve(topic)}"
        self._resolve = resolve
        #: Why the vehicle's own positioning cannot be flown by; empty if it can, or has none.
        self.positioning = ""

    def set_box(self, box: Box) -> None:
        """Set the box of the geofence."""
        self.box = box

    def set_controller(self, has_controller: bool) -> None:
        """Record whether the filter sees a controller."""
        self.has_controller = has_controller
        self._had_controller = self._had_controller or has_controller

    def may_become_complete(self, now: float) -> bool:
        """Return whether something is missing at ``now`` (s) that has never been there."""
        lacks_state = self.parameters.state_topic is not None and self.measured.motion is None
        lacks_controller = not self.has_controller and not self._had_controller
        return lacks_state or lacks_controller or bool(self.vehicle.connection_refusal(now))

    def refusal(self, now: float, report: FilterReport) -> str:
        """Return why the vehicle must not take off at ``now`` (s); empty if it may."""
        if report.refusal:
            return report.refusal
        if report.state is FilterState.EMERGENCY:
            return f"emergency, {report.reason}; reset it first"
        topic = self.parameters.state_topic
        return (
            hover_complaint(self.parameters.hover, self.box)
            or self.vehicle.takeoff_refusal(now)
            or self.positioning
            or (topic and self.measured.explanation(now, self._resolve(topic)))
            or self._stance_complaint(now)
            or ("" if self.has_controller else _NO_CONTROLLER)
            or self.inhibition
            or self.battery_complaint(now)
        )

    def _stance_complaint(self, now):
        if self.is_tilted:
            return TILTED
        position, z = self.measured.position(now), self.parameters.hover_z
        if position is None or z - position[2] >= TOUCHDOWN_HEIGHT:
            return ""
        at = f"the vehicle is at {position[2]:.2f} m"
        return f"hover/z is {z:g} m, and {at}; expected a point above it"

    def state_complaint(self, now: float) -> str:
        """Return that the state is not known any more, and why; empty if it is, or never was."""
        topic, measured = self.parameters.state_topic, self.measured
        if topic is None or measured.motion is None or measured.position(now) is not None:
            return ""
        text = f"the state on {self._resolve(topic)} was lost in the liftoff"
        return ": ".join(filter(None, (text, measured.missing_reason)))

    def battery_complaint(self, now: float) -> str:
        """Return that the battery is low or critical; empty if it is not."""
        if self.battery.charge(now) in (Charge.LOW, Charge.CRITICAL):
            return f"the battery is low, {self.battery.voltage:.2f} V"
        return ""


def _battery_fault(checks, flight):
    is_critical = checks.battery.charge(flight.time) is Charge.CRITICAL
    return checks.battery_complaint(flight.time) if is_critical else ""


#: What ends a flight for the server; a filter has its own table (`crazyflie_takeoff.guards`).
WATCH: tuple[Guard, ...] = (
    Guard(
        "vehicle cannot fly",
        AIRBORNE,
        lambda checks, flight: checks.vehicle.flight_fault(flight.time, flight.left_ground),
        Request.END,
        "{}",
        MAX_FAULT_TIME,
    ),
    # Whether it has lifted off, and how fast it is, is not seen then.
    Guard(
        "state is lost in the liftoff",
        OPEN_LOOP,
        lambda checks, flight: checks.state_complaint(flight.time),
        Request.SINK,
        "{}",
    ),
    Guard("battery is critical", FLYING, _battery_fault, Request.LAND, "{}"),
    # Before the driver stops to publish poses, so that a landing begins while there are some.
    Guard(
        "positioning is lost",
        FLYING,
        lambda checks, flight: checks.positioning,
        Request.LAND,
        "{}",
        POSITIONING_PATIENCE,
    ),
)
