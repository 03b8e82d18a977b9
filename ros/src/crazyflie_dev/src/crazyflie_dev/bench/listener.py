"""Records arrival and stamp of the messages of topics, from another process.

    python3 -m crazyflie_dev.bench.listener SECONDS NODE TOPIC TYPE [NODE TOPIC TYPE]...

prints a list of [topic, arrival in ns, stamp in ns], as JSON; times are the machine's. It speaks
TCPROS (http://wiki.ros.org/ROS/TCPROS) in one thread, decodes the stamps only, and is not
registered with the master, so that its own work is not measured.
"""

import io
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
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<2I")

#: Where a stamp is in a serialized message; behind a sequence number if nothing else is said.
_STAMP_AT = {"tf2_msgs/TFMessage": 8, "rosgraph_msgs/Clock": 0}
_LIMIT = 10.0  #: How long, in s, a publisher may take to answer.


class Connection:
    """A connection to a topic of one node, by full names; the type is such as std_msgs/String."""

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
        write_ros_handshake_header(self.socket, fields)
        received = io.BytesIO()
        read_ros_handshake_header(self.socket, received, 65536)
        self._buffer = received.getvalue()  # What has come behind the header.

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
            seconds, nanoseconds = _TIME.unpack_from(self._buffer, _LENGTH.size + self._stamp_at)
            stamps.append(seconds * 1_000_000_000 + nanoseconds)
            self._buffer = self._buffer[end:]
        return stamps


def listen(seconds: float, connections: list[Connection]) -> list[tuple[str, int, int]]:
    """Return topic, arrival and stamp, in ns, of all messages that arrive within ``seconds``."""
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
    topics = iter(sys.argv[2:])
    connections = [Connection(*each) for each in zip(topics, topics, topics, strict=True)]
    found = listen(float(sys.argv[1]), connections)
    json.dump(found, sys.stdout)
