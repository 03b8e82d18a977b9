"""What has to be there before a vehicle takes off."""

from collections.abc import Callable

from crazyflie_takeoff.battery import Charge
from crazyflie_takeoff.driver_connection import DriverConnection
from crazyflie_takeoff.limits import Box
from crazyflie_takeoff.motion import MeasuredPosition
from crazyflie_takeoff.server_states import Event, FilterReport
from crazyflie_takeoff.takeoff_server_parameters import TakeoffServerParameters, hover_complaint


class TakeoffChecks:
    """What is known of estimator, controller, driver, battery and geofence.

    ``resolve(topic)`` returns the absolute name of a topic. ``parameters`` may be replaced by
    others of the same topics.
    """

    def __init__(self, parameters: TakeoffServerParameters, resolve: Callable[[str], str]):
        self.parameters = parameters
        self.box = parameters.box
        self.position = MeasuredPosition()
        self.driver = DriverConnection()
        self.battery = parameters.battery()
        # Without a filter nothing publishes whether there is one.
        self.has_controller = True
        self._had_controller = False
        topic = parameters.inhibition_topic
        # Why another node refuses takeoffs; empty if it does not.
        self.inhibition = "" if topic is None else f"nothing has come on {resolve(topic)}"
        self._resolve = resolve

    def set_box(self, box: Box) -> None:
        """Take the geofence's box."""
        self.box = box

    def set_controller(self, has_controller: bool) -> None:
        """Take whether the filter sees a controller."""
        self.has_controller = has_controller
        self._had_controller = self._had_controller or has_controller

    def may_become_complete(self, now: float) -> bool:
        """Return whether something is missing that has never been there; ``now`` in s."""
        lacks_state = self.parameters.state_topic is not None and not self.position.is_measured
        lacks_controller = not self.has_controller and not self._had_controller
        return lacks_state or lacks_controller or bool(self._driver_refusal(now))

    def refusal(self, now: float, report: FilterReport) -> str:
        """Return why the vehicle must not take off at a time (s); empty if it may."""
        if report.event is Event.FILTER_REFUSES:
            return report.reason
        if report.event is Event.FILTER_EMERGENCY:
            return f"emergency, {report.reason}; it has to be reset first"
        return (
            hover_complaint(self.parameters.hover, self.box)
            or self._driver_refusal(now)
            or self.driver.cannot_fly(now)
            or self._position_refusal(now)
            or self._controller_refusal()
            or self.inhibition
            or self.battery_complaint(now)
        )

    def battery_complaint(self, now: float) -> str:
        """Return that the battery is low or critical; empty if it is not."""
        if self.battery.charge(now) in (Charge.LOW, Charge.CRITICAL):
            return f"the battery is low, {self.battery.voltage:.2f} V"
        return ""

    def _driver_refusal(self, now):
        topic = self.parameters.connected_topic
        return "" if topic is None else self.driver.refusal(now, self._resolve(topic))

    def _position_refusal(self, now):
        topic = self.parameters.state_topic
        return "" if topic is None else self.position.explanation(now, self._resolve(topic))

    def _controller_refusal(self):
        return (
            "" if self.has_controller else "no commanded controls come; is the controller running?"
        )
