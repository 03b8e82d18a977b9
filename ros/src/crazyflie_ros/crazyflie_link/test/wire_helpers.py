"""Packets that came over the link."""


def only_packet(target, port, channel):
    """Return the data of the only packet on a port and channel, once it is there."""
    (data,) = target.wait_for_packets(port, channel)
    return data
