"""A second launch on the master of a flight is refused, and changes nothing about the flight."""

import pytest
import rospy
from std_srvs.srv import Trigger

from crazyflie_reports.flight_operator import ready_operator
from crazyflie_utils.ros1.master_watch import living_node
from crazyflie_utils.testing.peer import wait_until
from crazyflie_utils.testing.programs import running

STACK = ("/state_estimator", "/lqr_controller", "/takeoff_server", "/takeoff_control_filter")
LOWEST, HIGHEST = 0.8, 1.2
"""Where the vehicle stays, m: a launch takes the processor from its nodes for a moment."""


class SecondLaunch:
    """Output of a launch while another one was flying."""

    def __init__(self, folder, operator, launch_file, arguments):
        self._log = folder / f"{launch_file}.log"
        command = ["roslaunch", "crazyflie_examples", f"{launch_file}.launch", "rviz:=false"]
        with (
            self._log.open("w") as output,
            running(*command, *arguments.split(), stdout=output, stderr=output) as process,
        ):
            wait_until(self._has_refused_all, f"refusals of {launch_file}")
            if launch_file == "sw_hover":
                # The simulator is required: roslaunch ends with it.
                wait_until(lambda: process.poll() is not None, "the end of the second launch")
            operator.hover(3.0)
        operator.hover(1.0)

    @property
    def output(self):
        """The output so far."""
        return self._log.read_text(errors="replace")

    def _has_refused_all(self):
        return all(f"{name} runs already: process" in self.output for name in STACK)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """Fly once, with one launch after the other on the same master; return all that was seen."""
    launches = rospy.get_param("/second_launch/launches")
    folder = tmp_path_factory.mktemp("launches")
    with ready_operator() as operator:
        operator.takeoff()
        operator.hover(2.0)
        before = {name: living_node(name) for name in STACK}
        seconds = {
            name: SecondLaunch(folder, operator, name, launches[name]) for name in sorted(launches)
        }
        after = {name: living_node(name) for name in STACK}
        operator.land()
        yield operator.finish(), seconds, before, after


def test_the_flight_goes_on(flight):
    record, _, before, after = flight
    assert None not in before.values()
    assert after == before
    heights = record.state.between(record.events["flying"], record.events["land"])[:, 2]
    assert heights.min() > LOWEST
    assert heights.max() < HIGHEST
    assert record.state.last[2] < 0.02
    assert record.final_control.last[3] == 0.0


def test_no_simulated_vehicle_joins_the_flight(flight):
    for second in flight[1].values():
        assert second.output.count("runs already: process") >= len(STACK)
    assert "REQUIRED process [simulator" in flight[1]["sw_hover"].output


def test_the_vehicle_of_the_controls_is_named(flight):
    owner = "simulated vehicle, by /simulator"
    if "hw_hover" in flight[1]:
        owner = "real vehicle, by /cmd_vel_converter"
        # The simulator's name is free, the controls that it would fly by are not.
        assert (
            "/control/final already fly a vehicle of /cmd_vel_converter"
            in flight[1]["sw_hover"].output
        )
    assert owner in rospy.ServiceProxy("/control/final/vehicle", Trigger)().message
