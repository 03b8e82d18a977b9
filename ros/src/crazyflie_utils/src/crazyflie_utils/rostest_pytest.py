"""Run a pytest file as the test node of a rostest.

In a .test file::

    <test pkg="crazyflie_utils" type="pytest_node" test-name="hover"
          args="$(find my_package)/test/rostest_hover.py" time-limit="60" />
"""

import sys
import warnings

import pytest
import rosgraph
import rospy

_OUTPUT = "--gtest_output=xml:"


def main() -> int:
    """Run pytest on the files named on the command line; return its exit status."""
    arguments = rospy.myargv(sys.argv)[1:]
    outputs = [a.removeprefix(_OUTPUT) for a in arguments if a.startswith(_OUTPUT)]
    files = [a for a in arguments if not a.startswith(_OUTPUT)]
    reports = [f"--junit-xml={outputs[-1]}"] if outputs else []
    if not rosgraph.is_master_online():
        print("pytest_node needs a ROS master: run it with rostest", file=sys.stderr)
        return 1
    rospy.init_node("pytest_node", anonymous=True, disable_signals=True)
    # rospy calls notifyAll, which Python 3.10 has deprecated, with every /clock.
    warnings.filterwarnings("ignore", message="notifyAll", category=DeprecationWarning)
    quiet = ["-W", "ignore:notifyAll:DeprecationWarning"]
    return pytest.main([*files, *reports, *quiet, "-p", "no:cacheprovider", "-v"])
