"""A publisher that violates the rules, written on the bare protocol (TCPROS).

It sends prepared bytes in one piece per millisecond, so that it does not limit a flood. As a
program it floods a topic from one line on its standard input to the next, and prints its number of
subscribers and of messages per second:

    python3 -m crazyflie_utils.testing.hostile_publisher TOPIC TYPE RATE [CONTENT]

CONTENT is the message in YAML, or its number of transforms.
"""

import contextlib
import io
import os
import select
import socket
import struct
import sys
import threading
import time
from types import SimpleNamespace
from xmlrpc.server import SimpleXMLRPCServer

import genpy
import rosgraph
import roslib.message
import yaml
from geometry_msgs.msg import TransformStamped
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header
from tf2_msgs.msg import TFMessage

_ADDRESS = "127.0.0.1"
_PERIOD = 0.001
_LIMIT = 10.0


class HostilePublisher:
    """Announces a topic with the master, and sends its subscribers any bytes.

    ``md5sum`` replaces that of the type. While it is not ready, its header refuses the
    subscription.
    """

    def __init__(
        self, topic: str, message_type: type[genpy.Message], md5sum: str = "", is_ready: bool = True
    ):
        self.is_ready = is_ready
        self._topic = topic
        self._type = message_type
        self._header = {
            "topic": topic,
            "type": message_type._type,
            "md5sum": md5sum or message_type._md5sum,
            "message_definition": message_type._full_text,
            "callerid": f"/hostile_{os.getpid()}_{id(self)}",
            "latching": "0",
        }
        self._sockets: list[socket.socket] = []
        self.accepted = 0  #: Number of connections so far.
        self.refused = 0  #: Number of connections that came too early.
        self._server = socket.create_server((_ADDRESS, 0))
        self._slave = SimpleXMLRPCServer((_ADDRESS, 0), logRequests=False)
        answers = {
            "requestTopic": ["TCPROS", *self._server.getsockname()],
            "getPublications": [[topic, message_type._type]],
        }
        self._slave.register_instance(
            SimpleNamespace(_dispatch=lambda method, _: (1, "", answers.get(method, 0)))
        )
        for work in (self._slave.serve_forever, self._accept):
            threading.Thread(target=work, daemon=True).start()
        self._master = rosgraph.Master(self._header["callerid"])
        self._uri = "http://{}:{}/".format(*self._slave.server_address)
        self._master.registerPublisher(topic, message_type._type, self._uri)

    def __enter__(self) -> "HostilePublisher":
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError, rosgraph.MasterException):
            self._master.unregisterPublisher(self._topic, self._uri)
        self._slave.shutdown()
        self._slave.server_close()
        self._server.close()
        for each in self._sockets:
            each.close()

    @property
    def connections(self) -> int:
        """Number of subscribers that are connected."""
        return len(self._sockets)

    def send(self, data: bytes) -> None:
        """Send bytes to all subscribers; those that have hung up are dropped."""
        for each in tuple(self._sockets):
            try:
                each.sendall(data)
            except OSError:
                self._sockets.remove(each)

    def _accept(self):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._server.accept()
                self.accepted += 1
                connection.settimeout(_LIMIT)
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                with contextlib.suppress(OSError, rosgraph.network.ROSHandshakeException):
                    read_ros_handshake_header(connection, io.BytesIO(), 4096)
                    if not self.is_ready:
                        refusal = {"error": f"this is not a publisher of [{self._topic}]"}
                        write_ros_handshake_header(connection, refusal)
                        connection.close()
                        self.refused += 1
                        continue
                    write_ros_handshake_header(connection, self._header)
                    self._sockets.append(connection)


def frame(message: genpy.Message) -> bytes:
    """Return a message as it is on the wire."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return struct.pack("<I", len(buffer.getvalue())) + buffer.getvalue()


def crowd(count: int) -> TFMessage:
    """Return the poses of a number of other bodies, about 100 bytes each."""
    transforms = []
    for number in range(count):
        transform = TransformStamped(child_frame_id=f"body{number:03d}")
        transform.header.frame_id = "world"
        transform.header.stamp = genpy.Time.from_sec(time.time())
        transform.transform.rotation.w = 1.0
        transforms.append(transform)
    return TFMessage(transforms)


def _flood(topic, type_name, rate, content="{}"):
    message_type = roslib.message.get_message_class(type_name)

    def prepare():
        if content.isdigit():
            return frame(crowd(int(content)))
        message = message_type()
        genpy.message.fill_message_args(message, [yaml.safe_load(content)])
        return frame(message)

    sent, data = 0, prepare()
    with HostilePublisher(topic, message_type) as publisher:
        sys.stdin.readline()
        start = time.monotonic()
        while not select.select([sys.stdin], [], [], 0.0)[0]:
            due = round((time.monotonic() - start) * rate)
            if due // 1000 != sent // 1000:
                data = prepare()
            publisher.send(data * (due - sent))
            sent = due
            time.sleep(_PERIOD)
        print(f"{publisher.connections} {sent / (time.monotonic() - start):.0f}", flush=True)


if __name__ == "__main__":
    _flood(sys.argv[1], sys.argv[2], float(sys.argv[3]), *sys.argv[4:])
