"""The driver in a process of its own, added to by its launch file, with virtual vehicles."""

import signal
import subprocess
import threading

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
    AddCrazyflie,
    AddCrazyflieRequest,
    Land,
    NotifySetpointsStop,
    RemoveCrazyflie,
    Takeoff,
    UpdateParams,
)
from crazyflie_utils.testing.peer import LIMIT, listening
from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.testing import virtual_vehicle


def launch(*arguments):
    """Run crazyflie_add.launch to its end; return what it printed."""
    return launch_file("crazyflie_driver", "crazyflie_add.launch", *arguments)


def launch_file(*arguments):
    command = ["roslaunch", "--screen", *arguments]
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


@pytest.fixture(scope="module")
def added(tmp_path_factory):
    """Add a virtual vehicle as cf1, with everything; return its address."""
    variables = tmp_path_factory.mktemp("log") / "blocks.yaml"
    variables.write_text("genericLogTopic_motors_Variables: [motor.m1, motor.m2]\n")
    with virtual_vehicle() as (_, uri):
        text = launch(
            f"uri:={uri}",
            "tf_prefix:=cf1",
            "enable_logging_pose:=True",
            "genericLogTopics:=[motors]",
            "genericLogTopicFrequencies:=[20]",
            f"genericLogTopicVariables_file:={variables}",
        )
        assert f"added {uri} as cf1" in text
        yield uri


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
    with listening("/cf1/pose", PoseStamped) as poses:
        call("/cf1/takeoff", Takeoff, 0, 0.4, Duration(1))
        assert poses.next(lambda message: message.pose.position.z > 0.35)
        call("/cf1/land", Land, 0, 0.0, Duration(1))
        assert poses.next(lambda message: message.pose.position.z < 0.05)


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
            listening("/diagnostics", DiagnosticArray) as diagnostics,
            listening("/cf1/motors", GenericLogData) as motors,
        ):
            status = diagnostics.next(lambda message: rate(message) > 10.0).status[0]
            motors.next(lambda message: min(message.values) > 10000.0)
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
    call("/remove_crazyflie", RemoveCrazyflie, added)
    published, subscribed, services = rosgraph.Master("/test").getSystemState()
    names = [name for each in (published, subscribed, services) for name, _ in each]
    assert not [name for name in names if name.startswith("/cf1/")]
    assert f"added {added}" in launch(f"uri:={added}", "tf_prefix:=/cf2/")
    with pytest.raises(rospy.ServiceException, match="cannot fly, its state is: .*locked"):
        call("/cf2/takeoff", Takeoff, 0, 0.4, Duration(1))
    call("/remove_crazyflie", RemoveCrazyflie, added)


WITHOUT_PREFIX = """
<launch>
  <include file="$(find crazyflie_driver)/launch/crazyflie_add.launch">
    <arg name="uri" value="{uri}" />
    <arg name="tf_prefix" value="" />
  </include>
</launch>
"""


def test_a_vehicle_without_a_prefix(added, tmp_path):
    path = tmp_path / "add.launch"
    path.write_text(WITHOUT_PREFIX.format(uri=added))
    text = launch_file(path)
    assert f": added {added} as /\n" in text
    assert rospy.wait_for_message("/imu", Imu, LIMIT).header.frame_id == "base_link"
    assert "effect" in rospy.get_param("/ring")
    call("/notify_setpoints_stop", NotifySetpointsStop, 0, 0)
    call("/remove_crazyflie", RemoveCrazyflie, added)


def terminate(process):
    return subprocess.Popen(["kill", str(process.pid)])


def rosnode_kill(_):
    return subprocess.Popen(["rosnode", "kill", "/ending_server"])


@pytest.mark.parametrize("end", [terminate, rosnode_kill])
def test_the_end_of_a_driver_with_the_watchdog_is_a_landing(end):
    names = ("/add_crazyflie", "/remove_crazyflie")
    command = ["rosrun", "crazyflie_driver", "crazyflie_server", "__name:=ending_server"]
    command += ["_emergency_watchdog:=true", *(f"{name}:=/ending{name}" for name in names)]
    with virtual_vehicle() as (virtual, uri):
        output = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        driver = subprocess.Popen(command, **output)
        call("/ending/add_crazyflie", AddCrazyflie, AddCrazyflieRequest(uri=uri, tf_prefix="cf9"))
        call("/cf9/takeoff", Takeoff, 0, 1.5, Duration(2))
        wait_until(lambda: virtual.observe().position[2] > 1.4, "the takeoff")
        asking = end(driver)
        speeds = []

        def is_down():
            seen = virtual.observe()
            speeds.append(-seen.velocity[2])
            return seen.position[2] < 0.02

        wait_until(is_down, "the ground", period=0.01)
        # A fall from there ends with 5.4 m/s.
        assert max(speeds) < 2.0
        assert speeds[-1] < 1.0
        text = driver.communicate(timeout=LIMIT)[0]
        assert asking.wait(LIMIT) == 0
    assert "cf9: the driver is to end: landing" in text
