"""Sends messages to a node until it answers, for the tests on a real master."""

import queue

import pytest
import rospy


def exchange(messages, answer_topic, answer_type, accept):
    """Publish messages over and over until an answer is accepted; return it.

    Parameters
    ----------
    messages : dict of str to message
        By topic.
    answer_topic, answer_type : str, type
    accept : callable
        Tells whether an answer is the one; earlier ones may come before all
        connections stand.
    """
    answers = queue.Queue()
    subscriber = rospy.Subscriber(answer_topic, answer_type, answers.put)
    publishers = {
        topic: rospy.Publisher(topic, type(message), queue_size=1)
        for topic, message in messages.items()
    }
    try:
        for _ in range(1000):
            for topic, message in messages.items():
                publishers[topic].publish(message)
            try:
                answer = answers.get(timeout=0.01)
            except queue.Empty:
                continue
            if accept(answer):
                return answer
    finally:
        for endpoint in (subscriber, *publishers.values()):
            endpoint.unregister()
    return pytest.fail(f"no such answer on {answer_topic} within 1000 attempts")
