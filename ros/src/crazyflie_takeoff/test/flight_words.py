"""The log of a network of processes, for the tests of whole flights."""

import itertools

from takeoff_helpers import text_of


def texts(messages):
    """Return texts and states that differ from the one before."""
    return [text for text, _ in itertools.groupby(map(text_of, messages))]


def states(network):
    return texts(message for _, message in network.on("/in_flight_flight_status"))


def thrusts(network, since=0.0, topic="/control/final"):
    return [message.control.thrust for _, message in network.on(topic, since)]


def until_on_ground(network):
    network.advance_until(lambda: network.last("/in_flight_flight_status") == "on_ground")
    network.advance(0.5)


def word(process):
    return text_of(process.published("/in_flight_flight_status")[-1])
