"""Somebody outside who listens to topics, and takes down when what arrived.

It speaks TCPROS (http://wiki.ros.org/ROS/TCPROS) itself, in one thread, and reads no more of a
message than its stamp, so that its own work is not measured. Nobody but the publishers knows of it:

    python3 -m crazyflie_dev.bench.listener SECONDS NODE TOPIC TYPE [NODE TOPIC TYPE]...

prints a list of [topic, arrival in ns, stamp in ns], as JSON; times are the machine's.
"""

import json
import selectors
import socket
import struct
import sys
import time
import xmlrpc.client
from typing import Any

import rosgraph
import roslib.message

_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<2I")

_STAMP_AT = {"tf2_msgs/TFMessage": 8, "rosgraph_msgs/Clock": 0}
"""Where a stamp is in a serialized message; behind a sequence number if nothing else is said."""

_LIMIT = 10.0
"""How long, in s, a publisher may take to answer."""


class Connection:
    """A topic of one publisher.

    Parameters
    ----------
    node, topic : str
        Their full names.
    message_type : str
        Such as std_msgs/String.
    """

    def __init__(self, node: str, topic: str, message_type: str):
        self.topic = topic
        self._stamp_at = _STAMP_AT.get(message_type, 4)
        uri = rosgraph.Master("/bench_listener").lookupNode(node)
        slave: Any = xmlrpc.client.ServerProxy(uri)
        _, text, answer = slave.requestTopic("/bench_listener", topic, [["TCPROS"]])
        if not answer:
            raise ConnectionError(f"{node} does not publish {topic}: {text}")
        _, host, port = answer
        self.socket = socket.create_connection((host, port), _LIMIT)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        fields = {
            "topic": topic,
            "type": message_type,
            "md5sum": roslib.message.get_message_class(message_type)._md5sum,
            "callerid": "/bench_listener",
            "tcp_nodelay": "1",
        }
        self.socket.sendall(_header(fields))
        self._buffer = b""
        self._is_greeted = False

    def receive(self) -> list[int]:
        """Return the stamps, in ns, of the messages that have come."""
        data = self.socket.recv(65536)
        if not data:
            raise ConnectionError(f"the publisher of {self.topic} has hung up")
        self._buffer += data
        stamps = []
        while len(self._buffer) >= _LENGTH.size:
            end = _LENGTH.size + _LENGTH.unpack_from(self._buffer)[0]
            if len(self._buffer) < end:
                break
            if self._is_greeted:
                seconds, nanoseconds = _TIME.unpack_from(
                    self._buffer, _LENGTH.size + self._stamp_at
                )
                stamps.append(seconds * 1_000_000_000 + nanoseconds)
            self._is_greeted = True
            self._buffer = self._buffer[end:]
        return stamps


def _header(fields):
    lines = [f"{key}={value}".encode() for key, value in fields.items()]
    body = b"".join(_LENGTH.pack(len(line)) + line for line in lines)
    return _LENGTH.pack(len(body)) + body


def listen(seconds: float, connections: list[Connection]) -> list[tuple[str, int, int]]:
    """Return topic, arrival and stamp, in ns, of all that comes in some ``seconds``."""
    arrivals = []
    with selectors.DefaultSelector() as selector:
        for each in connections:
            selector.register(each.socket, selectors.EVENT_READ, each)
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            for key, _ in selector.select(left):
                now = time.time_ns()
                arrivals += [(key.data.topic, now, stamp) for stamp in key.data.receive()]
    return arrivals


if __name__ == "__main__":
    wanted = iter(sys.argv[2:])
    connections = [Connection(*each) for each in zip(wanted, wanted, wanted, strict=True)]
    found = listen(float(sys.argv[1]), connections)
    json.dump(found, sys.stdout)
