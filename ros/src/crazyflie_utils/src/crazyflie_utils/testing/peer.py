"""A peer of the node under test, for rostests: it uses plain rospy, like foreign nodes."""

import contextlib
import queue
import time
from collections.abc import Callable, Iterator

import genpy
import rospy

from crazyflie_utils.testing.programs import LIMIT, wait_until

__all__ = ["LIMIT", "Received", "exchange", "listening", "wait_until"]


def _anything(message: genpy.Message) -> bool:
    return True


class Received(queue.Queue[genpy.Message]):
    """The messages that have come on a topic, oldest first."""

    def next(self, accept: Callable[[genpy.Message], bool] = _anything) -> genpy.Message:
        """Return the next message for which ``accept(message)``; fail after `LIMIT`."""
        message = None
        end = time.monotonic() + LIMIT
        while (left := end - time.monotonic()) > 0.0:
            with contextlib.suppress(queue.Empty):
                message = self.get(timeout=left)
                if accept(message):
                    return message
        raise AssertionError(f"no such message within {LIMIT:g} s; the last one: {message}")

    def drain(self) -> list[genpy.Message]:
        """Remove and return all messages that have come so far."""
        return [self.get() for _ in range(self.qsize())]


@contextlib.contextmanager
def listening(topic: str, message_type: type[genpy.Message]) -> Iterator[Received]:
    """Subscribe to a topic for the time of a with block."""
    received = Received()
    subscriber = rospy.Subscriber(topic, message_type, received.put, tcp_nodelay=True)
    try:
        yield received
    finally:
        subscriber.unregister()


#: By topic, one for the life of the process. A rospy subscriber that is told of a new publisher of
#: a process before it has noticed that the one before it hung up takes it for that one, and never
#: connects.
_publishers: dict[str, rospy.Publisher] = {}


def exchange(
    messages: dict[str, genpy.Message],
    answer_topic: str,
    answer_type: type[genpy.Message],
    accept: Callable[[genpy.Message], bool] = _anything,
) -> genpy.Message:
    """Publish messages, by topic, repeatedly until an answer is accepted; return it.

    Fails without one within `LIMIT`. The first messages may be lost before connections are made,
    and the node may answer some of them before it has received all.
    """
    end = time.monotonic() + LIMIT
    for topic, message in messages.items():
        if topic not in _publishers:
            _publishers[topic] = rospy.Publisher(topic, type(message), queue_size=1)
    with listening(answer_topic, answer_type) as answers:
        while time.monotonic() < end:
            for topic, message in messages.items():
                _publishers[topic].publish(message)
            # At a limited rate: answers to each message must not become a flood.
            pause = time.monotonic() + 0.01
            with contextlib.suppress(queue.Empty):
                while (rest := pause - time.monotonic()) > 0.0:
                    answer = answers.get(timeout=rest)
                    if accept(answer):
                        return answer
    raise AssertionError(f"no such answer on {answer_topic} within {LIMIT:g} s")
