"""Peers that send nonsense, floods, or nothing at all: they are ignored, and named once."""

import contextlib
import socket
import struct
import threading
import time

import genpy
import pytest
import rosgraph
import rospy
from rosgraph.network import write_ros_handshake_header
from std_msgs.msg import Float64MultiArray, Int64, Int64MultiArray, String
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage

from crazyflie_utils import TransformError
from crazyflie_utils.main import ros_process
from crazyflie_utils.testing.hostile_publisher import HostilePublisher, crowd, frame
from crazyflie_utils.testing.peer import LIMIT, wait_until


@pytest.fixture(scope="module")
def process():
    process = ros_process()
    process.start()
    yield process
    process.stop()


@pytest.fixture
def handle(process):
    handle = process.handle(rospy.get_name()).child()
    yield handle
    handle.close()


@pytest.fixture
def warnings(process, monkeypatch):
    """Return what is logged during the test."""
    texts = []
    monkeypatch.setattr(process.transport, "log", lambda level, text: texts.append(text))
    return texts


def heard(handle, topic, message_type):
    """Subscribe and return the list of what comes."""
    received = []
    handle.subscribe(topic, message_type, received.append)
    return received


def connected(hostile):
    wait_until(lambda: hostile.connections, "the connection")
    return hostile


# Publishers.


def test_another_type_is_refused_once(process, handle, warnings):
    received = heard(handle, "/md5", String)
    with HostilePublisher("/md5", String, "0" * 32) as hostile:
        connected(hostile).send(frame(String("junk")))
        wait_until(lambda: warnings, "a complaint")
        # rospy by itself would try again after half a second.
        for _ in range(3):
            with HostilePublisher("/md5", String) as proper:
                connected(proper).send(frame(String("proper")))
                wait_until(lambda: len(received) > 0, "the proper publisher")
                received.clear()
        time.sleep(1.0)
        assert hostile.accepted <= 8
    (warning,) = warnings
    assert "on /md5: std_msgs/String [00000000000000000000000000000000] in the place" in warning
    assert [key for key in process.transport.refused if "/md5" in key][0][0] == "type"


def test_a_publisher_of_another_type_that_refuses_is_named_once(handle, warnings):
    # As a proper publisher does it: its answer is an error.
    received = heard(handle, "/other_type", String)
    with HostilePublisher("/other_type", Int64) as hostile:
        hostile._header["error"] = "topic types do not match: [std_msgs/String] vs. [..]"
        wait_until(lambda: hostile.accepted, "the connection")
        wait_until(lambda: warnings, "a complaint")
        time.sleep(1.5)
        assert hostile.accepted == 1
    assert len(warnings) == 1
    assert "topic types do not match" in warnings[0]
    assert received == []


@pytest.mark.parametrize(
    ("topic", "message_type", "junk"),
    [
        ("/long_text", String, struct.pack("<I", 2**32 - 1)),
        ("/long_array", Float64MultiArray, struct.pack("<III", 0, 0, 2**32 - 1) + bytes(80)),
        ("/many_dimensions", Float64MultiArray, struct.pack("<I", 2**32 - 1) + bytes(80)),
        ("/short", Int64, b"xyz"),
        ("/empty", Int64, b""),
    ],
)
def test_what_cannot_be_read_is_dropped_and_the_connection_kept(
    process, handle, warnings, topic, message_type, junk
):
    received = heard(handle, topic, message_type)
    with HostilePublisher(topic, message_type) as hostile:
        connected(hostile)
        for _ in range(50):
            hostile.send(struct.pack("<I", len(junk)) + junk)
        hostile.send(frame(message_type()))
        wait_until(lambda: message_type() in received, "the message that can be read")
        assert hostile.accepted == 1
    if topic != "/long_text":
        # A text that is shorter than it says is taken for what is there.
        assert received == [message_type()]
        (warning,) = warnings
        assert f"a message on {topic} that cannot be read" in warning
        assert process.transport.refused["unreadable", topic] == 50


def test_a_publisher_that_is_not_ready_is_asked_again(handle):
    received = heard(handle, "/late", Int64)
    with HostilePublisher("/late", Int64, is_ready=False) as late:
        wait_until(lambda: late.refused, "the first question")
        late.is_ready = True
        wait_until(lambda: late.accepted > late.refused, "another one")

        def is_heard():
            late.send(frame(Int64(1)))
            return received

        wait_until(is_heard, "a message")


def test_a_message_without_end_is_not_waited_for(process, handle, warnings):
    received = heard(handle, "/endless", String)
    with HostilePublisher("/endless", String) as hostile:
        connected(hostile).send(struct.pack("<I", 2**32 - 1))

        def send_on():
            hostile.send(bytes(100_000))
            return not hostile.connections

        wait_until(send_on, "the end of the connection")
    assert received == []
    assert len(warnings) == 1
    assert "4294967295 bytes" in warnings[0]


def test_of_a_flood_only_the_latest_is_taken(handle, warnings):
    received = heard(handle, "/flood", Int64)
    others = heard(handle, "/flood_not", Int64)
    count = 40_000
    with (
        HostilePublisher("/flood", Int64) as hostile,
        HostilePublisher("/flood_not", Int64) as proper,
    ):
        connected(hostile)
        connected(proper)
        for start in range(0, count, 100):
            hostile.send(b"".join(frame(Int64(start + k)) for k in range(100)))
            if start % 1000 == 0:
                proper.send(frame(Int64(start)))
        wait_until(lambda: received and received[-1].data == count - 1, "the last one")
        wait_until(lambda: len(others) == count // 1000, "all on the other topic")
    numbers = [message.data for message in received]
    assert numbers == sorted(numbers)
    assert len(numbers) < count // 4
    assert warnings == ["more than 2000 messages a second on /flood"]


def test_of_a_flood_of_transforms_lossless(handle, process):
    lookup = handle.listen_to_transforms()
    with HostilePublisher("/tf", TFMessage) as hostile:
        connected(hostile)
        mine = crowd(1)
        mine.transforms[0].child_frame_id = "crazyflie"
        hostile.send(frame(mine) + frame(crowd(80)) * 3000)
        hostile.send(frame(crowd(2)))
        wait_until(lambda: "body001" in process.transforms._tree._unread, "the crowd")
    found = lookup("world", "crazyflie")
    assert found.header.stamp == genpy.Time.from_sec(mine.transforms[0].header.stamp.to_sec())


def test_transforms_may_come_in_pieces(handle):
    lookup = handle.listen_to_poses()

    def pose(x):
        message = crowd(1)
        message.transforms[0].child_frame_id = "cut"
        message.transforms[0].transform.translation.x = x
        return frame(message)

    def is_at(x):
        with contextlib.suppress(TransformError):
            return lookup("world", "cut").position[0] == x

    with HostilePublisher("/tf", TFMessage) as publisher:
        connected(publisher)
        data = pose(1.0) + pose(2.0)
        for start in range(0, len(data), 50):
            publisher.send(data[start : start + 50])
            is_at(1.0)
        wait_until(lambda: is_at(2.0), "the second one")
        publisher.send(pose(3.0) * 1000 + pose(4.0))
        wait_until(lambda: is_at(4.0), "the last one")


# Subscribers, and any other client.


def address(handle):
    """Return where this process takes connections."""
    uri = rosgraph.Master("/test").lookupNode(handle.name)
    proxy = rospy.core.xmlrpcapi(uri)
    _, _, (_, host, port) = proxy.requestTopic("/test", "/rosout", [["TCPROS"]])
    return host, port


def header(topic, **changes):
    return {
        "topic": topic,
        "type": String._type,
        "md5sum": String._md5sum,
        "callerid": "/stranger",
        "tcp_nodelay": "1",
        **changes,
    }


def test_silent_and_nonsensical_clients_block_no_other(handle, warnings):
    handle.advertise_service("~alive", Trigger, lambda request: TriggerResponse(True, "yes"))
    strangers = [socket.create_connection(address(handle)) for _ in range(5)]
    for stranger in strangers[2:]:
        stranger.sendall(struct.pack("<I", 2**31) + bytes(100))
    # By a connection, as outsiders do.
    name = handle.resolve("~alive")
    rospy.wait_for_service(name, LIMIT)
    assert rospy.ServiceProxy(name, Trigger)().message == "yes"
    for stranger in strangers:
        stranger.close()


def test_a_subscriber_of_another_type_is_refused_and_named_once(handle, warnings):
    handle.publisher("/wanted", String)
    for _ in range(20):
        with socket.create_connection(address(handle)) as stranger:
            stranger.settimeout(LIMIT)
            write_ros_handshake_header(stranger, header("/wanted", md5sum="0" * 32))
            assert b"datatype/md5sum" in stranger.recv(4096)

    def complaints():
        # In addition to the warnings about peers of other tests.
        return [text for text in warnings if "/wanted" in text]

    wait_until(complaints, "a complaint")
    assert len(complaints()) == 1


def test_a_frozen_subscriber_neither_blocks_nor_fills_the_memory(handle):
    publisher = handle.publisher("/frozen", Int64MultiArray)
    with socket.create_connection(address(handle)) as stranger:
        stranger.settimeout(LIMIT)
        fields = header("/frozen", type=Int64MultiArray._type, md5sum=Int64MultiArray._md5sum)
        write_ros_handshake_header(stranger, fields)
        wait_until(publisher.has_subscribers, "the subscriber")
        done = threading.Event()

        def publish():
            for number in range(1000):
                publisher.publish(Int64MultiArray(data=[number] * 10_000))
            done.set()

        threading.Thread(target=publish, daemon=True).start()
        assert done.wait(LIMIT)
        (connection,) = publisher._external._publisher.impl.connections
        assert len(connection._waiting) <= 100
        # When it awakes it gets whole messages: those of before, and the last hundred.
        stream = stranger.makefile("rb")
        read_frame(stream)
        numbers = []
        while not numbers or numbers[-1] < 999:
            message = Int64MultiArray().deserialize(read_frame(stream))
            assert len(message.data) == 10_000 and len(set(message.data)) == 1
            numbers.append(message.data[0])
        assert numbers[-100:] == list(range(900, 1000))
        assert numbers == sorted(set(numbers))
        # Then it is one like any other.
        wait_until(lambda: not connection._rest, "the rest")
        publisher.publish(Int64MultiArray(data=[1000]))
        assert Int64MultiArray().deserialize(read_frame(stream)).data == (1000,)


def read_frame(stream):
    """Return the next message, or the header of the connection, without its length."""
    (size,) = struct.unpack("<I", stream.read(4))
    return stream.read(size)
