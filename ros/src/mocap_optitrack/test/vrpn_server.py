"""A VRPN server: trackers whose poses a test sets.

Protocol: vrpn 07.35, https://github.com/vrpn/vrpn/wiki. The client names its address in a datagram;
the server connects to it, and each side begins with a version. All numbers are big-endian.
"""

import contextlib
import socket
import struct
import threading
import time

_VERSION = b"vrpn: ver. 07.35  0".ljust(24, b"\0")
_SENDER, _TYPE = -1, -2
_POSE = 1
_PERIOD = 0.01


def message(kind, sender, body):
    """Return a message; its length is that without the padding at its end."""
    now = time.time()
    head = struct.pack(">IIIiiI", 24 + len(body), int(now), int(now % 1 * 1e6), sender, kind, 0)
    return head + body + b"\0" * (-len(body) % 8)


def described(kind, number, name):
    """Return the message that gives a sender or a type its number."""
    text = name.encode() + b"\0"
    return message(kind, number, struct.pack(">I", len(text)) + text)


class VrpnServer:
    """Sends ``poses``, name -> (x, y, z, qx, qy, qz, qw), with noise, to one client at a time."""

    def __init__(self, poses):
        self.poses = dict(poses)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._is_over.set()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
            end.sendto(b"", self._socket.getsockname())
        self._thread.join(20.0)
        self._socket.close()

    def _run(self):
        while not self._is_over.is_set():
            data = self._socket.recv(1024)
            if data:
                host, port = data.rstrip(b"\0").split()
                with contextlib.suppress(OSError):
                    self._serve(host.decode(), int(port))

    def _serve(self, host, port):
        with socket.create_connection((host, port), 10.0) as client:
            client.sendall(_VERSION)
            client.recv(len(_VERSION), socket.MSG_WAITALL)
            threading.Thread(target=_drain, args=(client,), daemon=True).start()
            client.sendall(described(_TYPE, _POSE, "vrpn_Tracker Pos_Quat"))
            numbers, noise = {}, 0.0
            while not self._is_over.wait(_PERIOD):
                noise = 1e-5 - noise
                for name, (x, *others) in self.poses.items():
                    pose = (x + noise, *others)
                    if name not in numbers:
                        numbers[name] = len(numbers)
                        client.sendall(described(_SENDER, numbers[name], name))
                    client.sendall(message(_POSE, numbers[name], struct.pack(">ii7d", 0, 0, *pose)))


def _drain(client):
    with contextlib.suppress(OSError):
        while client.recv(4096):
            pass
