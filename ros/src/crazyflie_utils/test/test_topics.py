"""Hand-over of messages within a process."""

import pytest
from std_msgs.msg import Empty, String

from crazyflie_utils.topics import ExternalPublisher, ExternalSubscriber, Topics


class Wire(ExternalPublisher):
    """The way out of one topic, with a listener or without."""

    def __init__(self, latch):
        self.latch = latch
        self.heard = False
        self.is_closed = False
        self.sent = []

    def has_subscribers(self):
        return self.heard

    def publish(self, message):
        self.sent.append(message)

    def close(self):
        self.is_closed = True


class Inlet(ExternalSubscriber):
    """A subscription of a topic outside."""

    def __init__(self, world, key):
        self._world = world
        self._key = key

    def has_publishers(self):
        return self._world.is_published

    def close(self):
        self._world.subscribed.remove(self._key)


class World:
    """The part of a transport that topics need."""

    def __init__(self):
        self.wires = []
        self.subscribed = []
        self.is_published = False

    def advertise(self, topic, message_type, latch):
        self.wires.append(Wire(latch))
        return self.wires[-1]

    def subscribe(self, topic, message_type, deliver, may_wait):
        self.subscribed.append((topic, message_type, deliver))
        return Inlet(self, (topic, message_type, deliver))


@pytest.fixture
def world():
    return World()


@pytest.fixture
def topics(world):
    return Topics(world)


def test_hands_over_the_very_object_once_to_every_subscriber(topics):
    received = []
    topics.subscribe("/a", String, lambda message: received.append(("first", message)))
    publisher = topics.publisher("/a", String, latch=False)
    topics.subscribe("/a", String, lambda message: received.append(("second", message)))
    topics.subscribe("/b", String, lambda message: received.append(("other", message)))
    message = String("x")
    publisher.publish(message)
    assert [name for name, _ in received] == ["first", "second"]
    assert all(each is message for _, each in received)


def test_several_publishers_of_a_topic(topics):
    received = []
    topics.subscribe("/a", String, received.append)
    publishers = [topics.publisher("/a", String, latch=False) for _ in range(2)]
    messages = [String("1"), String("2")]
    for publisher, message in zip(publishers, messages, strict=True):
        publisher.publish(message)
    assert received == messages


def test_leaves_the_process_only_for_listeners(topics, world):
    publisher = topics.publisher("/a", String, latch=False)
    publisher.publish(String("no subscriber"))
    world.wires[0].heard = True
    message = String("heard")
    publisher.publish(message)
    assert world.wires[0].sent == [message]
    assert not world.wires[0].latch


def test_latched_messages_always_leave_for_those_who_come_later(topics, world):
    publisher = topics.publisher("/a", String, latch=True)
    message = String("x")
    publisher.publish(message)
    assert world.wires[0].latch
    assert world.wires[0].sent == [message]


def test_latched_message_reaches_late_subscribers_in_the_process(topics):
    publisher = topics.publisher("/a", String, latch=True)
    publisher.publish(String("old"))
    last = String("last")
    publisher.publish(last)
    received = []
    topics.subscribe("/a", String, received.append)
    assert len(received) == 1
    assert received[0] is last


def test_what_is_not_latched_does_not_reach_late_subscribers(topics):
    topics.publisher("/a", String, latch=False).publish(String("x"))
    received = []
    topics.subscribe("/a", String, received.append)
    assert received == []


def test_every_subscriber_hears_those_outside(topics, world):
    # Each is announced, so that a late one is sent what is latched outside.
    received = []
    for name in ("first", "second"):
        topics.subscribe("/a", String, lambda message, name=name: received.append(name))
    assert [(topic, kind) for topic, kind, _ in world.subscribed] == [("/a", String)] * 2
    for _, _, deliver in world.subscribed:
        deliver(String("from outside"))
    assert received == ["first", "second"]


def test_type_clashes_are_named(topics):
    topics.publisher("/a", String, latch=False)
    topics.subscribe("/a", String, lambda message: None)
    expected = "topic /a carries std_msgs/String, not std_msgs/Empty"
    with pytest.raises(TypeError, match=expected):
        topics.publisher("/a", Empty, latch=False)
    with pytest.raises(TypeError, match=expected):
        topics.subscribe("/a", Empty, lambda message: None)


def test_message_of_another_type_is_refused(topics):
    publisher = topics.publisher("/a", String, latch=False)
    received = []
    topics.subscribe("/a", String, received.append)
    for wrong in (Empty(), "text", String):
        with pytest.raises(TypeError, match="topic /a carries std_msgs/String, not"):
            publisher.publish(wrong)
    assert received == []


def test_publisher_knows_its_topic(topics):
    assert topics.publisher("/a", String, latch=False).topic == "/a"


def test_who_has_unsubscribed_is_told_no_more(topics, world):
    received = []
    first = topics.subscribe("/a", String, lambda message: received.append("first"))
    topics.subscribe("/a", String, lambda message: received.append("second"))
    publisher = topics.publisher("/a", String, latch=False)
    first.close()
    publisher.publish(String("x"))
    assert received == ["second"]
    assert len(world.subscribed) == 1


def test_unsubscribing_while_a_message_is_delivered_skips_no_other(topics):
    received = []
    ends = []

    def receive_once(message):
        received.append("first")
        ends[0].close()

    ends.append(topics.subscribe("/a", String, receive_once))
    topics.subscribe("/a", String, lambda message: received.append("second"))
    publisher = topics.publisher("/a", String, latch=False)
    publisher.publish(String("x"))
    publisher.publish(String("y"))
    assert received == ["first", "second", "second"]


def test_a_publisher_that_is_closed_tells_those_outside(topics, world):
    topics.publisher("/a", String, latch=False).close()
    assert world.wires[0].is_closed


def test_what_a_closed_publisher_says_or_has_latched_is_lost(topics, world):
    received = []
    publisher = topics.publisher("/a", String, latch=True)
    publisher.publish(String("latched"))
    publisher.close()
    topics.subscribe("/a", String, received.append)
    publisher.publish(String("too late"))
    assert received == []
    assert [message.data for message in world.wires[0].sent] == ["latched"]


def test_what_another_has_latched_stays(topics):
    received = []
    first, second = (topics.publisher("/a", String, latch=True) for _ in range(2))
    first.publish(String("of the first"))
    second.publish(String("of the second"))
    second.close()
    topics.subscribe("/a", String, received.append)
    assert [message.data for message in received] == ["of the first"]


def test_a_publisher_knows_of_subscribers_here_and_outside(topics, world):
    publisher = topics.publisher("/a", String, latch=False)
    world.wires[0].heard = False
    assert not publisher.has_subscribers()
    subscriber = topics.subscribe("/a", String, lambda message: None)
    assert publisher.has_subscribers()
    subscriber.close()
    assert not publisher.has_subscribers()
    world.wires[0].heard = True
    assert publisher.has_subscribers()


def test_a_subscriber_knows_of_publishers_here_and_outside(topics, world):
    subscriber = topics.subscribe("/a", String, lambda message: None)
    assert not subscriber.has_publishers()
    publisher = topics.publisher("/a", String, latch=False)
    assert subscriber.has_publishers()
    publisher.close()
    assert not subscriber.has_publishers()
    world.is_published = True
    assert subscriber.has_publishers()
