"""The hardware example on virtual hardware: the vehicle's log data, takeoffs, observations."""

import contextlib
import socket

import rospy
from faulty_flight import LIMIT, Observer
from std_msgs.msg import String

from crazyflie_driver.msg import GenericLogData
from crazyflie_model.supervisor import SupervisorState
from crazyflie_reports.flight_operator import FlightError
from crazyflie_reports.flight_record import Series
from crazyflie_utils.testing.peer import wait_until

_VARIABLES = (
    *("stateEstimate.z", "stateEstimate.vz"),
    *("motor.m1", "motor.m2", "motor.m3", "motor.m4"),
    "supervisor.info",
)
LOG_PARAMETER = f"genericLogTopic_truth_Variables: [{', '.join(_VARIABLES)}]"
"""The driver's parameter of the log block, as YAML."""

_RESTART = bytes((0xFF, 0xFE, 0xF0, 0x01))
"""The radio chip's command to restart the firmware."""


class Vehicle:
    """Log data of the virtual vehicle, whose estimate is the truth and not motion capture."""

    def __init__(self, port):
        self.uri = f"udp://127.0.0.1:{port}"
        self._address = ("127.0.0.1", port)
        self._log = Series(_VARIABLES)
        self.words = []
        rospy.Subscriber("/crazyflie/status", String, lambda status: self.words.append(status.data))
        rospy.Subscriber("/crazyflie/truth", GenericLogData, self._note)

    def _note(self, message):
        self._log.append(message.header.stamp.to_sec(), message.values)

    def is_logging(self):
        """Return whether there are log data of the last 0.3 s."""
        return len(self._log) > 0 and rospy.get_time() - self._log.last_time < 0.3

    def wait_for_log_of(self, moment):
        """Wait until log data of a moment (s), or of a later one, have come."""
        wait_until(lambda: self._log.last_time >= moment, "the vehicle's log data", LIMIT)

    @property
    def height(self):
        """The latest, m."""
        return float(self._log.last[0])

    @property
    def is_locked(self):
        """Whether only a restart makes it fly again."""
        return SupervisorState.LOCKED in SupervisorState(int(self._log.last[6]))

    def fastest_descent_since(self, begin):
        """Return the greatest speed downward since a moment (s), m/s."""
        return -float(self._log.between(begin, float("inf"))[:, 1].min())

    def highest_pwm_since(self, begin):
        """Return the greatest of all motors since a moment (s)."""
        return float(self._log.between(begin, float("inf"))[:, 2:6].max())

    def motors_stop_after(self, begin):
        """Return how long after a moment (s) all motors stand still for good, s."""
        times = self._log.times
        runs = self._log.values[: len(times), 2:6].any(axis=1)
        return max(0.0, float(times[runs][-1]) - begin)

    def motors_stand_still(self):
        """Return whether all motors stand still."""
        return not self._log.last[2:6].any()

    def restart(self):
        """Restart the firmware at once; its client gets no notice."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
            radio.sendto(_RESTART, self._address)


class HardwareFlight:
    """Commands and observations of the hardware example, flown with a virtual vehicle."""

    def __init__(self, port):
        self.observer = Observer()
        self.vehicle = Vehicle(port)

    def wait_for_vehicle(self):
        """Wait for log data of the vehicle and for its state from motion capture."""
        wait_until(self.vehicle.is_logging, "the vehicle's log data", LIMIT)
        wait_until(lambda: rospy.get_time() - self.observer.now < 0.2, "the state", LIMIT)

    def lift_off(self):
        """Take off."""
        self.observer.takeoff()
        wait_until(lambda: self.vehicle.height > 0.5, "the vehicle to lift off", LIMIT)

    def take_off(self):
        """Take off and hover; return the greatest height, m."""
        begin = self.observer.now
        self.observer.takeoff()
        self.observer.hover(4.0)
        return self.observer.range_since(begin)[1]

    def is_back_at(self, height):
        """Wait a while for the vehicle to be at a height (m); return where it is."""
        with contextlib.suppress(AssertionError):
            wait_until(lambda: abs(self.observer.height - height) < 0.05, "the height", LIMIT)
        return self.observer.height

    def wait_for_ground(self):
        """Wait until the vehicle's own estimate is on the ground."""
        wait_until(lambda: self.vehicle.height < 0.03, "the ground", LIMIT)

    def refusal(self):
        """Return what a takeoff is refused with."""
        try:
            self.observer.takeoff()
        except FlightError as error:
            return str(error)
        return ""
