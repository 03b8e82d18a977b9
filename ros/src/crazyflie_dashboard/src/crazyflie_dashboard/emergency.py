"""The emergency: services are called over connections of their own, which are kept open.

The lane shares no thread, queue or connection with other commands. Once a service has been found,
the master is not needed.
"""

import contextlib
import io
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from urllib.parse import urlsplit

from rosgraph.network import (
    ROSHandshakeException,
    read_ros_handshake_header,
    write_ros_handshake_header,
)
from std_srvs.srv import Empty

from crazyflie_dashboard.master import Master
from crazyflie_dashboard.page_data import Outcomes
from crazyflie_utils.ros1.calls import has_closed

#: Largest age of a click, and longest time for an answer (s).
MAX_EMERGENCY_AGE = 5.0
#: Services that are called first.
ALL = ("/all/emergency", "/crazyflie_server/all/emergency")

_CONNECT_LIMIT = 2.0  #: Longest time for a connection in advance (s).
_PERIOD = 1.0  #: Shortest period of requests to the master (s).
_SHARE = 0.02  #: Largest fraction of time that requests to the master take.
_EMPTY = struct.pack("<I", 0)  #: A serialized request of std_srvs/Empty: a length of zero.


class EmergencyLane:
    """Calls of all emergency services of the graph.

    Connections to them are opened as soon as the master names them, also while no page is open.
    `stop` may be called from any thread, and waits for nothing.

    ``report(text)`` is called for each emergency and its outcome.
    """

    def __init__(self, master: Master, report: Callable[[str], None]):
        self._master, self._report = master, report
        self._lock = threading.Lock()
        self._nodes: dict[str, str] = {}
        self._addresses: dict[str, str] = {}
        self._open: dict[str, socket.socket] = {}
        self._trouble = "the master has not answered yet"
        self._is_closed = threading.Event()
        threading.Thread(target=self._follow, name="emergency", daemon=True).start()

    @property
    def ready(self) -> tuple[str, ...]:
        """Services to which a connection is open."""
        with self._lock:
            return tuple(self._open)

    def close(self) -> None:
        """Close the connections."""
        self._is_closed.set()
        with self._lock:
            for connection in self._open.values():
                connection.close()
            self._open.clear()

    def stop(self, services: Iterable[str] | None, age: float) -> "Future[Outcomes]":
        """Call emergency services, of all vehicles if ``services`` is None.

        ``age`` is how long ago the operator clicked (s). The future has an outcome for each
        service, after 5 s at the latest; its text is "" if it has answered.
        """
        result: Future[Outcomes] = Future()
        services = None if services is None else list(dict.fromkeys(services))
        what = "all vehicles" if services is None else ", ".join(services)
        if not age <= MAX_EMERGENCY_AGE:
            text = f"the click is {age:.1f} s old; expected at most {MAX_EMERGENCY_AGE:g} s"
            self._end(what, result, {"emergency": f"{text}; nothing was done"})
            return result
        with self._lock:
            wanted = sorted(self._nodes, key=_order) if services is None else list(services)
            # Each connection serves one call at a time: a second click opens others.
            taken = {name: self._open.pop(name) for name in wanted if name in self._open}
        deadline = time.monotonic() + MAX_EMERGENCY_AGE
        if not wanted:
            self._end(what, result, {"emergency": f"no service has been found: {self._trouble}"})
            return result
        # Open connections send the request at once, in order; nothing here waits.
        sent = {name for name, connection in taken.items() if _send(connection)}
        texts: dict[str, str] = {}

        def finish(name, text):
            with self._lock:
                texts[name] = text
                is_last = len(texts) == len(wanted)
            if is_last:
                self._end(what, result, {each: texts[each] for each in wanted})

        def await_answers():
            for name in (each for each in wanted if each in sent):
                finish(name, self._answer(name, taken[name], deadline))

        def call(name):
            try:
                connection = self._reach(name, deadline)
                _send(connection)
            except OSError as error:
                finish(name, str(error) or "it does not answer")
            else:
                finish(name, self._answer(name, connection, deadline))

        if sent:
            threading.Thread(target=await_answers, daemon=True).start()
        for name in wanted:
            if name not in sent:
                threading.Thread(target=call, args=(name,), daemon=True).start()
        return result

    def _end(self, what, result, texts):
        result.set_result(texts)
        failures = "; ".join(f"{name}: {text}" for name, text in texts.items() if text)
        self._report(f"emergency for {what}: {failures or 'all services have answered'}")

    def _answer(self, name, connection, deadline):
        """Return why a call has failed, or ""; a connection that has answered stays open."""
        try:
            connection.settimeout(max(deadline - time.monotonic(), 0.001))
            with connection.makefile("rb") as stream:
                head = stream.read(5)
                if len(head) < 5:
                    raise OSError("the other side has closed it")
                is_done, length = struct.unpack("<BI", head)
                words = stream.read(length).decode(errors="replace")
        except TimeoutError:
            connection.close()
            return f"it has not answered within {MAX_EMERGENCY_AGE:g} s"
        except OSError as error:
            connection.close()
            return f"the connection has ended: {error}"
        self._keep(name, connection)
        return "" if is_done else words or "it has refused"

    def _keep(self, name, connection):
        with self._lock:
            before = self._open.get(name)
            if before is None and not self._is_closed.is_set():
                self._open[name] = connection
            else:
                connection.close()

    def _reach(self, name: str, deadline: float) -> socket.socket:
        """Open a connection where the service was last, or where the master says that it is."""
        address = self._addresses.get(name)
        if address is not None:
            with contextlib.suppress(OSError):
                return self._connect(name, address, deadline)
        return self._connect(name, self._master.lookup(name), deadline)

    def _connect(self, name: str, address: str, deadline: float) -> socket.socket:
        limit = deadline - time.monotonic()
        if limit <= 0.0:
            raise OSError(f"it has not answered within {MAX_EMERGENCY_AGE:g} s")
        uri = urlsplit(address)
        connection = socket.create_connection((uri.hostname or "", uri.port or 0), limit)
        try:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            header = {
                "callerid": self._master.caller,
                "service": name,
                "md5sum": Empty._md5sum,
                "type": Empty._type,
                "persistent": "1",
            }
            write_ros_handshake_header(connection, header)
            # Only an answer shows that the process runs: the kernel accepts connections for a
            # stopped one.
            answer = read_ros_handshake_header(connection, io.BytesIO(), 4096)
            if "error" in answer:
                raise OSError(answer["error"])
        except (OSError, ROSHandshakeException) as error:
            connection.close()
            is_late = isinstance(error, TimeoutError)
            text = f"it has not answered within {limit:.0f} s" if is_late else str(error)
            raise OSError(text) from None
        with self._lock:
            self._addresses[name] = address
        return connection

    def _follow(self):
        while not self._is_closed.is_set():
            began = time.monotonic()
            try:
                known = self._master.services().items()
                self._update({name: node for name, node in known if is_emergency(name)})
                self._trouble = "no node on the graph offers it"
            except Exception as error:
                # Any error is ignored: the next request may succeed, and known services stay.
                self._trouble = str(error)
            with self._lock:
                ended = [n for n, connection in self._open.items() if _has_ended(connection)]
                for name in ended:
                    self._open.pop(name).close()
                missing = [name for name in self._nodes if name not in self._open]
            for name in sorted(missing, key=_order):
                with contextlib.suppress(OSError):
                    self._keep(name, self._reach(name, time.monotonic() + _CONNECT_LIMIT))
            self._is_closed.wait(max(_PERIOD, (time.monotonic() - began) / _SHARE * _PERIOD))

    def _update(self, nodes):
        with self._lock:
            moved = [n for n, node in self._nodes.items() if nodes.get(n) != node]
            for name in moved:
                self._addresses.pop(name, None)
                if name in self._open:
                    self._open.pop(name).close()
            self._nodes = nodes


def is_emergency(service: str) -> bool:
    """Return whether a service stops motors, by its name; those of high_level only call another."""
    return service.endswith("/emergency") and not service.endswith("/high_level/emergency")


def _order(name):
    return name not in ALL, name


def _send(connection: socket.socket) -> bool:
    """Send a request if the other side has not ended the connection."""
    if _has_ended(connection):
        connection.close()
        return False
    try:
        connection.sendall(_EMPTY)
    except OSError:
        connection.close()
        return False
    return True


def _has_ended(connection):
    connection.setblocking(False)
    return has_closed(connection)
