"""A user's node in plain rospy, in one process with handles: nothing is changed for it."""

import contextlib
import queue
import threading

import genpy
import pytest
import rospy
import tf2_ros
from processes import composed
from rospy.impl import registration, tcpros_base, tcpros_pubsub
from sensor_msgs.msg import Image
from std_msgs.msg import Int64
from transform_helpers import transform

from crazyflie_utils import TransformError
from crazyflie_utils.main import ros_process
from crazyflie_utils.testing.peer import LIMIT, wait_until


@pytest.fixture(scope="module")
def handle():
    """Return a handle of a process; a second process object changes nothing."""
    process = ros_process()
    server = tcpros_base._tcpros_server
    callback = server._tcp_server_callback
    ros_process()
    assert server._tcp_server_callback == callback
    process.start()
    yield process.handle(rospy.get_name())
    process.stop()


def exchanged(topic, message, **options):
    """Return what a plain subscriber receives of a plain publisher in this process."""
    received = queue.Queue()
    subscriber = rospy.Subscriber(topic, type(message), received.put, **options)
    publisher = rospy.Publisher(topic, type(message), queue_size=1)
    try:
        wait_until(publisher.get_num_connections, "the connection to itself")
        publisher.publish(message)
        return received.get(timeout=LIMIT)
    finally:
        subscriber.unregister()
        publisher.unregister()


def test_large_images_are_received(handle):
    image = Image(height=5000, width=8000, encoding="rgb8", step=24000, data=bytes(120_000_000))
    assert len(exchanged("/image", image, buff_size=2**24).data) == 120_000_000


def test_remappings_apply_to_plain_topics_and_to_those_of_handles(handle):
    assert handle.resolve("/camera") == rospy.resolve_name("/camera") == "/front/camera"
    assert exchanged("/camera", Int64(3)) == Int64(3)
    assert rospy.Publisher("/camera", Int64, queue_size=1).resolved_name == "/front/camera"


def test_a_queue_of_one_keeps_the_latest_message(handle):
    blocked, received = threading.Event(), []

    def receive(message):
        received.append(message.data)
        blocked.wait(LIMIT)

    subscriber = rospy.Subscriber("/queue", Int64, receive, queue_size=1)
    publisher = rospy.Publisher("/queue", Int64, queue_size=1000)
    wait_until(publisher.get_num_connections, "the connection to itself")
    publisher.publish(Int64(0))
    wait_until(lambda: received == [0], "the first message")
    (connection,) = publisher.impl.connections
    for number in range(1, 500):
        publisher.publish(Int64(number))
    wait_until(lambda: connection.stat_num_msg == 500, "all to be sent")
    blocked.set()
    wait_until(lambda: received[-1] == 499, "the last message")
    assert len(received) < 10
    subscriber.unregister()


def test_a_plain_subscriber_receives_what_a_handle_publishes(handle):
    by_handle, plain = [], []
    publisher = handle.publisher("/both", Int64)
    handle.subscribe("/both", Int64, lambda message: by_handle.append(message.data))
    subscriber = rospy.Subscriber("/both", Int64, lambda message: plain.append(message.data))
    wait_until(publisher._external.has_subscribers, "the connection to itself")

    def is_received():
        publisher.publish(Int64(1))
        return plain

    wait_until(is_received, "a message")
    publisher.publish(Int64(2))
    wait_until(lambda: plain[-1] == 2, "the last message")
    # Not a second time by the connection.
    assert by_handle.count(2) == 1
    subscriber.unregister()


def test_a_handle_receives_what_plain_rospy_publishes(handle):
    received = queue.Queue()
    handle.subscribe("/plain", Int64, received.put)
    publisher = rospy.Publisher("/plain", Int64, queue_size=1)
    wait_until(publisher.get_num_connections, "the connection to itself")
    publisher.publish(Int64(7))
    assert received.get(timeout=LIMIT) == Int64(7)


def test_tf2_ros_listens_and_broadcasts(handle):
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    lookup = handle.listen_to_transforms()
    broadcast = handle.broadcast_transforms()
    tf2_ros.StaticTransformBroadcaster().sendTransform(transform("drone", "camera", 0.0, x=0.1))

    def is_known():
        broadcast([transform("world", "drone", rospy.get_time(), x=1.0)])
        return buffer.can_transform("world", "camera", genpy.Time())

    wait_until(is_known, "tf2_ros to know the frame")
    x = []

    def is_known_to_the_handle():
        with contextlib.suppress(TransformError):
            x.append(lookup("world", "camera").transform.translation.x)
        return x

    wait_until(is_known_to_the_handle, "the handle to know the frame")
    assert x == [pytest.approx(1.1)]
    listener.unregister()


def test_rospy_is_unchanged(handle):
    """Classes and modules are rospy's own; what is changed is in objects of handles."""
    assert rospy.topics.QueuedConnection is tcpros_pubsub.QueuedConnection
    for owner in (
        rospy.topics._SubscriberImpl,
        rospy.topics._PublisherImpl,
        rospy.topics._TopicManager,
        tcpros_base.TCPROSTransport,
        tcpros_base.TCPROSServer,
        registration.RegManager,
        registration.RegistrationListeners,
    ):
        for function in vars(owner).values():
            assert getattr(function, "__module__", "rospy").startswith("rospy")
    assert tcpros_base.logwarn is rospy.core.logwarn


def test_other_processes_are_served(handle):
    rospy.set_param("/herald", {"topics": {"out": "/heralded"}})
    received = queue.Queue()
    rospy.Subscriber("/heralded", Int64, received.put)
    with composed("outside", herald="Herald"):
        assert received.get(timeout=LIMIT) == Int64(42)
