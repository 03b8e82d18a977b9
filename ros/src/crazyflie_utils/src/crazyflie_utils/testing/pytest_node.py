"""Run pytest files as the test node of a rostest.

In a .test file::

    <test pkg="crazyflie_utils" type="pytest_node" test-name="hover"
          args="$(find my_package)/test/rostest_hover.py" time-limit="120" />
"""

import signal
import sys

import pytest
import rosgraph
import rospy

_OUTPUT = "--gtest_output=xml:"
_TEXT = "--text"


def pytest_arguments(arguments: list[str]) -> list[str]:
    """Return the arguments of pytest for those that rostest gives.

    rostest names a file for the results, in the way of gtest; with ``rostest -t`` it names none.
    """
    converted = [each.replace(_OUTPUT, "--junit-xml=") for each in arguments if each != _TEXT]
    # The plugin of anyio, which the dashboard brings, costs each test 0.1 s.
    converted += ["-p", "no:cacheprovider", "-p", "no:anyio", "-v"]
    # rospy calls notifyAll, which Python 3.10 has deprecated, with every /clock.
    return [*converted, "-W", "ignore:notifyAll:DeprecationWarning"]


class InterruptIsFailure:
    """Plugin of pytest: an interrupt fails the running test, and ends the run.

    It also knows the marker of long tests.

    roslaunch interrupts the tests when a required node dies. To pytest by itself that is
    no failure, so that rostest would count the tests that were not run as passed.
    """

    def pytest_configure(self, config: pytest.Config) -> None:
        """Declare the marker of tests that `./run tests` skips, beside those of a package."""
        config.addinivalue_line("markers", "long: takes long; only in ./run tests --all")

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        """Install the signal handler."""

        def stop(*_):
            session.shouldfail = "interrupted"
            pytest.fail("interrupted: has a required node died?")

        signal.signal(signal.SIGINT, stop)


def main() -> int:
    """Run pytest on the files named on the command line; return its exit status."""
    if not rosgraph.is_master_online():
        print("pytest_node needs a ROS master: run it with rostest", file=sys.stderr)
        return 1
    rospy.init_node("pytest_node", anonymous=True, disable_signals=True)
    try:
        arguments = pytest_arguments(rospy.myargv(sys.argv)[1:])
        return pytest.main(arguments, plugins=[InterruptIsFailure()])
    finally:
        # rospy's sending threads would keep the process alive.
        rospy.signal_shutdown("tests are through")
