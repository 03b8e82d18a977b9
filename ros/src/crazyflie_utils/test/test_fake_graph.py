"""The fake graph against what processes of a real one would see."""

import pytest
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from crazyflie_utils import Node, ServiceError
from crazyflie_utils.testing import FakeGraph


class Talker(Node):
    """Counts aloud, ten times a second, and greets each newcomer."""

    def load_parameters(self, handle):
        self._count = 0

    def register_callbacks(self, handle):
        self._numbers = handle.publisher("/numbers", Float64)
        handle.publisher("/greeting", String, latch=True).publish(String("hello"))
        handle.advertise_service("/count", Trigger, self._on_count)
        handle.timer(0.1, self._on_timer)

    def _on_timer(self):
        self._count += 1
        self._numbers.publish(Float64(self._count))

    def _on_count(self, _):
        return TriggerResponse(True, str(self._count))


class Listener(Node):
    """Writes down what it hears, and when."""

    def load_parameters(self, handle):
        self.heard = []

    def register_callbacks(self, handle):
        handle.subscribe("/greeting", String, self._note)
        self.subscriber = handle.subscribe("/numbers", Float64, self._note)

    def _note(self, message):
        self.heard.append((round(self._handle.time(), 6), message.data))


class Unusable(Node):
    """Cannot be initialized."""

    def load_parameters(self, handle):
        raise RuntimeError("broken by design")


@pytest.fixture
def graph():
    return FakeGraph({}, start=10.0)


@pytest.fixture
def listener(graph):
    node = Listener()
    graph.start("/talker", Talker())
    graph.start("/listener", node)
    return node


def test_messages_arrive_at_once_and_latched_ones_late(graph, listener):
    graph.advance(0.25)
    assert listener.heard == [(10.0, "hello"), (10.1, 1.0), (10.2, 2.0)]


def test_who_is_killed_says_nothing_more(graph, listener):
    assert listener.subscriber.has_publishers()
    graph.kill("/talker")
    graph.advance(1.0)
    assert not graph.is_alive("/talker")
    assert not listener.subscriber.has_publishers()
    assert listener.heard == [(10.0, "hello")]
    with pytest.raises(ServiceError, match="there is no service /count"):
        graph.call("/count", TriggerRequest()).result()


def test_a_restarted_process_begins_at_the_beginning(graph, listener):
    graph.advance(0.35)
    graph.kill("/talker")
    graph.start("/talker", Talker())
    graph.advance(0.15)
    assert listener.heard[-1] == (10.45, 1.0)


def test_what_came_while_it_was_frozen_comes_when_it_goes_on(graph, listener):
    graph.freeze("/listener")
    graph.advance(0.35)
    assert listener.heard == [(10.0, "hello")]
    graph.thaw("/listener")
    assert listener.heard[1:] == [(10.35, 1.0), (10.35, 2.0), (10.35, 3.0)]


def test_many_messages_of_one_topic_push_out_none_of_another(graph, listener):
    graph.freeze("/listener")
    graph.publish("/greeting", String("you missed me"))
    graph.advance(20.0)
    graph.thaw("/listener")
    missed = [data for _, data in listener.heard[1:]]
    assert missed == ["you missed me", *range(101, 201)]


def test_frozen_timers_skip_what_they_missed(graph, listener):
    graph.freeze("/talker")
    graph.advance(5.0)
    graph.thaw("/talker")
    graph.advance(0.1)
    assert [number for _, number in listener.heard[1:]] == [1.0, 2.0]


def test_calls_wait_for_a_frozen_process_unless_they_are_given_up(graph, listener):
    graph.freeze("/talker")
    patient, impatient = (graph.call("/count", TriggerRequest()) for _ in range(2))
    assert not patient.done()
    assert impatient.cancel()
    graph.thaw("/talker")
    assert patient.result().message == "0"
    assert impatient.cancelled()


def test_an_interrupted_process_goes_on_until_its_end(graph, listener):
    graph.interrupt("/talker")
    graph.advance(0.1)
    assert [number for _, number in listener.heard[1:]] == [1.0]
    graph.end("/talker")
    graph.advance(0.2)
    assert [number for _, number in listener.heard[1:]] == [1.0]
    assert not graph.is_alive("/talker")


def test_faults_change_what_arrives(graph, listener):
    overheard = []
    graph.listen("/numbers", lambda message: overheard.append(message.data))
    graph.faults["/numbers"] = lambda message: [message, message] if message.data == 2.0 else []
    graph.advance(0.35)
    assert [number for _, number in listener.heard[1:]] == [2.0, 2.0]
    assert overheard == [1.0, 2.0, 3.0]


def test_the_outside_calls_and_publishes(graph, listener):
    graph.advance(0.3)
    assert graph.call("/count", TriggerRequest()).result().message == "3"
    graph.publish("/numbers", Float64(7.0))
    assert listener.heard[-1] == (10.3, 7.0)
    assert graph.stamp().to_sec() == pytest.approx(10.3)


def test_a_node_that_cannot_be_initialized_is_named(graph):
    with pytest.raises(RuntimeError, match=r"/bad was not initialized.*broken by design"):
        graph.start("/bad", Unusable())


def test_recorders_are_told_of_every_change(graph, listener):
    """They look at who publishes and listens only then."""
    seen = [graph.changes()]

    def has_changed():
        seen.append(graph.changes())
        return seen[-1] not in seen[:-1]

    graph.advance(1.0)
    assert not has_changed()
    listener.subscriber.close()
    assert has_changed()
    graph.listen("/numbers", print)
    assert has_changed()
    graph.kill("/talker")
    assert has_changed()
    graph.start("/talker", Talker())
    assert has_changed()
