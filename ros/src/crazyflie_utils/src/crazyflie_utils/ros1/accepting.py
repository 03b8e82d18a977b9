"""Peers that connect to this process: each has a thread and a limit of time to say what for."""

import io
import threading
from typing import Any

import rospy
from rosgraph.network import (
    ROSHandshakeException,
    read_ros_handshake_header,
    write_ros_handshake_header,
)

from crazyflie_utils.ros1.receiving import Report

_HEADER_LIMIT = 5.0  #: How long, in s, a peer may take to send its header.
MAX_PENDING = 32  #: Connections whose header has not come yet.


class Acceptor:
    """In the place of ``TCPROSServer._tcp_server_callback``, which reads one header at a time."""

    def __init__(self, server: Any, report: Report):
        self._server = server
        self._report = report
        self._places = threading.BoundedSemaphore(MAX_PENDING)

    def __call__(self, sock: Any, address: tuple[str, int]) -> None:
        """Answer a connection in a thread of its own, or close it if too many are pending."""
        if self._places.acquire(blocking=False):
            threading.Thread(target=self._answer, args=(sock, address), daemon=True).start()
        else:
            sock.close()

    def _answer(self, sock, address):
        try:
            sock.settimeout(_HEADER_LIMIT)
            header = read_ros_handshake_header(sock, io.BytesIO(), 4096)
            sock.settimeout(None)
            error = self._handle(sock, address, header)
            if error:
                write_ros_handshake_header(sock, {"error": error})
                raise ROSHandshakeException(error)
        except Exception as error:
            sock.close()
            if not rospy.core.is_shutdown_requested():
                text = f"refusing a connection from {address[0]}: {error!s:.250}"
                self._report(text, ("connection", str(error)[:250]))
        finally:
            self._places.release()

    def _handle(self, sock, address, header):
        """Return why a connection is refused, or a false value."""
        if rospy.core.is_shutdown_requested():
            return "node shutting down"
        if "topic" in header:
            return self._server.topic_connection_handler(sock, address, header)
        if "service" in header:
            return self._server.service_connection_handler(sock, address, header)
        return "no topic or service name detected"
