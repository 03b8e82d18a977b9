"""Vicon, Qualisys and VRPN, over the motioncapture package in a process of its own."""

import contextlib
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable

from typing_extensions import override

from mocap_optitrack import library_worker
from mocap_optitrack.frame_times import ArrivalTimes
from mocap_optitrack.frames import Frame, SeenBody
from mocap_optitrack.source import Source, SourceError

SYSTEMS = ("vicon", "qualisys", "vrpn")  #: Systems other than NatNet.
_MARGIN = 2.0  #: Time that is added to the worker's own limit of connecting (s).

_LARGEST = 2**18  #: Largest packet (bytes): a frame of 2000 bodies has as many.


class LibrarySource(Source):
    """A system that the motioncapture package knows, one of `SYSTEMS`.

    The package reports neither the time of a frame nor which bodies are tracked. So frames have the
    time of their arrival at the package, which `ArrivalTimes` estimates for those that have waited
    there. A body is treated as tracked if its pose differs from that of the previous frame:
    measurements of a body at rest differ by their noise, and a system that has lost a body, or its
    cameras, repeats the last pose to the last bit.

    ``host`` is name or address of the server; for VRPN also with a port, ``vicon:3884``.
    ``clock()`` returns the local time, s. With ``needs_points``, a package without unlabelled
    markers is refused.
    """

    _socket: socket.socket  # Each packet is a value; see `library_worker`.

    def __init__(
        self, system: str, host: str, clock: Callable[[], float], needs_points: bool = False
    ):
        self._needs_points = needs_points
        self._points: list[list[float]] = []
        self._system = system
        self._host = host
        self._clock = clock
        self._opened = contextlib.ExitStack()
        self._times = ArrivalTimes()
        self._last: dict[str, tuple[float, ...]] = {}

    @override
    def open(self) -> str:
        name, colon, port = self._host.partition(":")
        try:
            # The package does not accept names.
            address = socket.gethostbyname(name) + colon + port
        except OSError as error:
            text = f"motioncapture_config/hostname {self._host!r} is unknown: {error}"
            raise SourceError(text) from None
        command = [sys.executable, "-m", library_worker.__name__, self._system, address]
        self._socket, output = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._opened.callback(self._socket.close)
        with output:
            self._worker = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=output.fileno()
            )
        self._opened.callback(self._worker.wait)
        self._opened.callback(self._worker.kill)
        packet = self._receive(library_worker.CONNECT_LIMIT + _MARGIN)
        if packet is None:
            raise SourceError(self._no_answer())
        if not self._parse(packet) and self._needs_points:
            raise SourceError(
                "the installed motioncapture package sends no unlabelled markers of "
                f"{self._system}, which single_markers need; use a version with pointCloud"
            )
        return f"{self._system} at {self._host}, over the motioncapture package"

    @override
    def read(self, limit: float) -> Frame | None:
        packet = self._receive(limit)
        if packet is None:
            return None
        moment, entries, points = self._parse(packet)
        waited, arrival = time.monotonic() - moment, self._clock()
        time_of_arrival = self._times.update(moment)
        bodies = [self._body(*entry) for entry in entries]
        are_new = points != self._points
        self._points = points
        if time_of_arrival is None or not (are_new or any(body.is_tracked for body in bodies)):
            # Some systems send frames without new data.
            return None
        waited += moment - time_of_arrival
        # Repeated poses are not measured ones.
        new = tuple((x, y, z) for x, y, z in points) if are_new else ()
        return Frame(None, None, arrival, tuple(bodies), waited, new)

    @property
    @override
    def silence_hint(self) -> str:
        return (
            f"{self._system} at {self._host} shows no body that moves by so much as its noise: "
            "is it live, and are its objects enabled?"
        )

    @override
    def close(self) -> None:
        self._opened.close()

    def _body(self, name, *pose):
        is_new = self._last.get(name, pose) != pose
        self._last[name] = pose
        return SeenBody(None, name, tuple(pose[:3]), tuple(pose[3:]), is_new)

    def _parse(self, packet):
        value = json.loads(packet)
        if isinstance(value, dict):
            raise SourceError(f"{self._system} at {self._host}: {value['error']}")
        return value

    def _receive(self, limit):
        self._socket.settimeout(limit)
        try:
            packet = self._socket.recv(_LARGEST)
        except TimeoutError:
            return None
        if not packet:
            raise SourceError(self._why_it_ended(self._worker.wait()))
        return packet

    def _why_it_ended(self, status):
        if status == -signal.SIGALRM:
            return self._no_answer()
        return (
            f"the motioncapture package ended with status {status} while it was connected to "
            f"{self._system} at {self._host}"
        )

    def _no_answer(self):
        return (
            f"{self._system} at {self._host} does not answer: is it running and streaming, is "
            "motioncapture_config/hostname right, and does a firewall let it pass?"
        )
