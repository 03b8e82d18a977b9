"""Run pytest files as the test node of a rostest.

In a .test file::

    <test pkg="crazyflie_utils" type="pytest_node" test-name="hover"
          args="$(find my_package)/test/rostest_hover.py" time-limit="60" />
"""

import sys

import pytest
import rosgraph
import rospy

_OUTPUT = "--gtest_output=xml:"
_TEXT = "--text"


def pytest_arguments(arguments: list[str]) -> list[str]:
    """Return what pytest is told when rostest says ``arguments``.

    rostest names a file for the results, in the way of gtest; with ``rostest -t``
    there is none.
    """
    told = []
    for argument in arguments:
        if argument.startswith(_OUTPUT):
            told.append("--junit-xml=" + argument.removeprefix(_OUTPUT))
        elif argument != _TEXT:
            told.append(argument)
    # rospy calls notifyAll, which Python 3.10 has deprecated, with every /clock.
    return [*told, "-p", "no:cacheprovider", "-v", "-W", "ignore:notifyAll:DeprecationWarning"]


def main() -> int:
    """Run pytest on the files named on the command line; return its exit status."""
    if not rosgraph.is_master_online():
        print("pytest_node needs a ROS master: run it with rostest", file=sys.stderr)
        return 1
    rospy.init_node("pytest_node", anonymous=True, disable_signals=True)
    try:
        return pytest.main(pytest_arguments(rospy.myargv(sys.argv)[1:]))
    finally:
        # rospy's sending threads would keep the process alive.
        rospy.signal_shutdown("tests are through")
