"""The log of a network of processes, for the tests of whole flights."""


def states(network):
    return [message.data for _, message in network.on("/in_flight_state")]


def thrusts(network, since=0.0, topic="/control/final"):
    return [message.control.thrust for _, message in network.on(topic, since)]


def until_on_ground(network):
    network.advance_until(lambda: network.last("/in_flight_state") == "on_ground")
    network.advance(0.5)


def word(process):
    return process.published("/in_flight_state")[-1].data
