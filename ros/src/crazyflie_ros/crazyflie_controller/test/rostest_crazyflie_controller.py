"""The controller in a process of its own, with its launch file, on a real master."""

import threading

import pytest
import rospy
from geometry_msgs.msg import PoseStamped, Quaternion, TransformStamped, Twist, Vector3
from std_srvs.srv import Empty
from tf2_msgs.msg import TFMessage

from crazyflie_utils.testing.peer import LIMIT, listening, wait_until


class TrackedVehicle:
    """A vehicle whose pose is published on tf 50 times a second; the test sets its height."""

    def __init__(self):
        self.z = 0.0
        self._publisher = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self):
        self._over.set()
        self._thread.join()

    def _run(self):
        while not self._over.wait(0.02):
            transform = TransformStamped()
            transform.header.stamp = rospy.Time.now()
            transform.header.frame_id, transform.child_frame_id = "world", "cf"
            transform.transform.translation = Vector3(0.0, 0.0, self.z)
            transform.transform.rotation = Quaternion(0.0, 0.0, 0.0, 1.0)
            self._publisher.publish(TFMessage([transform]))


@pytest.fixture
def vehicle():
    vehicle = TrackedVehicle()
    yield vehicle
    vehicle.stop()


@pytest.fixture
def setpoints():
    with listening("/crazyflie/cmd_vel", Twist) as setpoints:
        yield setpoints


def call(name):
    """Call one of the controller's services as soon as it is not refused."""
    name = f"/crazyflie/controller/{name}"
    rospy.wait_for_service(name, timeout=LIMIT)

    def is_accepted():
        try:
            rospy.ServiceProxy(name, Empty)()
        except rospy.ServiceException:
            # The controller may not have a pose yet.
            return False
        return True

    wait_until(is_accepted, f"{name} to be accepted")


def test_takes_off_goes_and_lands(vehicle, setpoints):
    assert setpoints.next() == Twist()
    goal = PoseStamped()
    goal.pose.position.x, goal.pose.position.z = 0.1, 0.5
    goal.pose.orientation.w = 1.0
    publisher = rospy.Publisher("/crazyflie/goal", PoseStamped, queue_size=1, latch=True)
    publisher.publish(goal)
    call("takeoff")
    assert setpoints.next(lambda s: s.linear.z > 5000.0).linear.x == 0.0
    vehicle.z = 0.5
    # The same error for long: 40 * 0.1 and a growing integral, at most 2 * 0.1.
    setpoint = setpoints.next(lambda s: s.linear.x > 4.0)
    assert setpoint.linear.x == pytest.approx(4.0, abs=0.21)
    assert setpoint.linear.y == pytest.approx(0.0, abs=1e-6)
    call("land")
    vehicle.z = 0.0
    setpoints.next(lambda s: s == Twist())
