"""The driver in a process of its own, added to by its launch file, with virtual vehicles."""

import queue
import signal
import subprocess
import threading
import time

import pytest
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from genpy import Duration
from geometry_msgs.msg import PoseStamped, Twist, Vector3
from sensor_msgs.msg import Imu
from std_srvs.srv import Empty

from crazyflie_driver.msg import GenericLogData, crtpPacket
from crazyflie_driver.srv import (
    Land,
    RemoveCrazyflie,
    Takeoff,
    UpdateParams,
)
from crazyflie_virtual.server import Server
from crazyflie_virtual.settings import Settings

LIMIT = 20.0


@pytest.fixture(scope="module")
def virtual():
    """Return a virtual vehicle."""
    server = Server(Settings(port=0, observer_port=0))
    server.start()
    yield server
    server.stop()


def uri(server):
    return f"udp://127.0.0.1:{server.address[1]}"


def launch(*arguments):
    """Run crazyflie_add.launch to its end; return what it printed."""
    command = ["roslaunch", "--screen", "crazyflie_driver", "crazyflie_add.launch", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    # roslaunch ends its nodes when it is interrupted, not when it is killed.
    interrupt = threading.Timer(LIMIT, process.send_signal, [signal.SIGINT])
    interrupt.start()
    try:
        return process.communicate()[0]
    finally:
        interrupt.cancel()


def call(name, service_type, *arguments):
    rospy.wait_for_service(name, LIMIT)
    return rospy.ServiceProxy(name, service_type)(*arguments)


class Listener:
    """What comes on a topic, to be waited for."""

    def __init__(self, topic, message_type):
        self._heard = queue.Queue()
        self._subscriber = rospy.Subscriber(topic, message_type, self._heard.put, tcp_nodelay=True)

    def wait_until(self, condition):
        """Return the first message for which ``condition`` holds."""
        end = time.monotonic() + LIMIT
        while not condition(message := self._heard.get(timeout=LIMIT)):
            assert time.monotonic() < end, f"in the end: {message}"
        return message

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._subscriber.unregister()


@pytest.fixture(scope="module")
def added(virtual, tmp_path_factory):
    """Add the virtual vehicle as cf1, with everything."""
    variables = tmp_path_factory.mktemp("log") / "blocks.yaml"
    variables.write_text("genericLogTopic_motors_Variables: [motor.m1, motor.m2]\n")
    text = launch(
        f"uri:={uri(virtual)}",
        "tf_prefix:=cf1",
        "enable_logging_pose:=True",
        "genericLogTopics:=[motors]",
        "genericLogTopicFrequencies:=[20]",
        f"genericLogTopicVariables_file:={variables}",
    )
    assert f"added {uri(virtual)} as cf1" in text
    return virtual


def test_what_the_vehicle_says_arrives(added):
    for topic, message_type in (
        ("imu", Imu),
        ("pose", PoseStamped),
        ("motors", GenericLogData),
    ):
        message = rospy.wait_for_message(f"/cf1/{topic}", message_type, LIMIT)
        assert abs((rospy.Time.now() - message.header.stamp).to_sec()) < LIMIT
    assert len(rospy.wait_for_message("/cf1/motors", GenericLogData, LIMIT).values) == 2
    assert crtpPacket._type == rosgraph_type("/cf1/packets")


def rosgraph_type(topic):
    return dict(rosgraph.Master("/test").getTopicTypes())[topic]


def test_parameters_of_the_firmware(added):
    assert len(rospy.get_param("/cf1/ring")) > 1
    rospy.set_param("/cf1/ring/effect", 5)
    call("/cf1/update_params", UpdateParams, ["ring/effect"])
    rospy.set_param("/cf1/ring/effect", 500)
    with pytest.raises(rospy.ServiceException, match="500 does not fit"):
        call("/cf1/update_params", UpdateParams, ["ring/effect"])


def test_a_flight(added):
    with Listener("/cf1/pose", PoseStamped) as poses:
        call("/cf1/takeoff", Takeoff, 0, 0.4, Duration(1))
        poses.wait_until(lambda message: message.pose.position.z > 0.35)
        call("/cf1/land", Land, 0, 0.0, Duration(1))
        poses.wait_until(lambda message: message.pose.position.z < 0.05)


def test_setpoints_and_diagnostics(added):
    publisher = rospy.Publisher("/cf1/cmd_vel", Twist, queue_size=1)
    stop = threading.Event()

    def stream():
        while not stop.wait(0.02):
            publisher.publish(Twist(Vector3(0.0, 0.0, 12000.0), Vector3()))

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        with (
            Listener("/diagnostics", DiagnosticArray) as diagnostics,
            Listener("/cf1/motors", GenericLogData) as motors,
        ):
            status = diagnostics.wait_until(lambda message: rate(message) > 10.0).status[0]
            motors.wait_until(lambda message: min(message.values) > 10000.0)
    finally:
        stop.set()
        thread.join()
        publisher.unregister()
    assert status.name == "crazyflie_server: cf1"
    assert status.level in (DiagnosticStatus.OK, DiagnosticStatus.WARN)


def rate(message):
    return float({v.key: v.value for v in message.status[0].values}["setpoints (Hz)"])


def test_a_vehicle_that_is_not_there():
    text = launch("uri:=udp://127.0.0.1:1", "tf_prefix:=nobody")
    assert "cannot add udp://127.0.0.1:1" in text
    assert "nothing listens on this port" in text
    assert "exit code 1" in text


def test_an_emergency_and_a_new_beginning(added):
    call("/cf1/emergency", Empty)
    with pytest.raises(rospy.ServiceException, match="emergency stop"):
        call("/cf1/takeoff", Takeoff, 0, 0.4, Duration(1))
    call("/remove_crazyflie", RemoveCrazyflie, uri(added))
    published, subscribed, services = rosgraph.Master("/test").getSystemState()
    names = [name for each in (published, subscribed, services) for name, _ in each]
    assert not [name for name in names if name.startswith("/cf1/")]
    assert f"added {uri(added)}" in launch(f"uri:={uri(added)}", "tf_prefix:=/cf2/")
    with pytest.raises(rospy.ServiceException, match="cannot fly, its state is: .*locked"):
        call("/cf2/takeoff", Takeoff, 0, 0.4, Duration(1))
