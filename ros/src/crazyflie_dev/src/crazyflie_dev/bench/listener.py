"""Records arrival and stamp of the messages of topics, from another process.

    python3 listener.py SECONDS NODE TOPIC [NODE TOPIC]...

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
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<2I")

#: Offset of a stamp in a serialized message; in others it follows a sequence number.
_STAMP_AT = {"/tf": 8, "/clock": 0}
_LIMIT = 10.0  #: Longest wait for an answer of a publisher (s).
_CALLER = "/bench_listener"


def connect(node: str, topic: str) -> tuple[socket.socket, bytearray]:
    """Return a connection to a topic of one node, and what has come on it already."""
    slave: Any = xmlrpc.client.ServerProxy(rosgraph.Master(_CALLER).lookupNode(node))
    _, text, answer = slave.requestTopic(_CALLER, topic, [["TCPROS"]])
    if not answer:
        raise ConnectionError(f"{node} does not publish {topic}: {text}")
    connection = socket.create_connection(tuple(answer[1:]), _LIMIT)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    names = {"topic": topic, "callerid": _CALLER}
    any_type = {"type": "*", "md5sum": "*"}
    write_ros_handshake_header(connection, {**names, **any_type, "tcp_nodelay": "1"})
    received = io.BytesIO()
    read_ros_handshake_header(connection, received, 65536)
    return connection, bytearray(received.getvalue())


def take_stamps(received: bytearray, stamp_at: int) -> list[int]:
    """Remove the complete messages from what was received; return their stamps, ns."""
    stamps = []
    while len(received) >= _LENGTH.size:
        end = _LENGTH.size + _LENGTH.unpack_from(received)[0]
        if len(received) < end:
            break
        seconds, nanoseconds = _TIME.unpack_from(received, _LENGTH.size + stamp_at)
        stamps.append(seconds * 1_000_000_000 + nanoseconds)
        del received[:end]
    return stamps


def main() -> None:
    """Listen for as long, and to the topics, that the command line names."""
    arrivals = []
    with selectors.DefaultSelector() as selector:
        for node, topic in zip(sys.argv[2::2], sys.argv[3::2], strict=True):
            connection, received = connect(node, topic)
            selector.register(connection, selectors.EVENT_READ, (topic, connection, received))
        end = time.monotonic() + float(sys.argv[1])
        while (left := end - time.monotonic()) > 0.0:
            for key, _ in selector.select(left):
                now = time.time_ns()
                topic, connection, received = key.data
                data = connection.recv(65536)
                if not data:
                    raise ConnectionError(f"the publisher of {topic} has hung up")
                received += data
                stamps = take_stamps(received, _STAMP_AT.get(topic, 4))
                arrivals += [(topic, now, stamp) for stamp in stamps]
    json.dump(arrivals, sys.stdout)


if __name__ == "__main__":
    main()
