"""Asks the ROS master and the nodes of a running graph; each answer has a time limit."""

import contextlib
import io
import socket
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import urlsplit
from xmlrpc.client import ServerProxy

import rosgraph
import roslib.message
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

from crazyflie_doctor.graph import Graph, Type

LIMIT = 2.0  #: Longest wait for one answer (s).

_AT_A_TIME = 16

_NAME = "/doctor"


def own_md5(kind: str, name: str) -> str | None:
    """Return the MD5 sum of a message ("msg") or service ("srv") type here; None if unknown."""
    get = {"msg": roslib.message.get_message_class, "srv": roslib.message.get_service_class}[kind]
    try:
        found = get(name)
    except Exception:
        # Importing a module of another workspace may raise anything.
        found = None
    return found and found._md5sum


def is_master_online() -> bool:
    """Tell whether a ROS master answers in time."""
    with _limited():
        try:
            # Nodes answer what `rosgraph.is_master_online` asks, too.
            rosgraph.Master(_NAME).getUri()
        except Exception:
            # No answer, one that no master gives, or an invalid URI.
            return False
        return True


@contextlib.contextmanager
def _limited():
    """Set a time limit for sockets made in this context; rospy's, made later, have none."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(LIMIT)
    try:
        yield
    finally:
        socket.setdefaulttimeout(before)


def graph() -> Graph:
    """Ask the master and all nodes, many at a time.

    OSError or rosgraph.MasterException: the master does not answer.
    """
    with _limited():
        return _graph(rosgraph.Master(_NAME))


def _graph(master):
    publishers, subscribers, services = (
        {name: set(nodes) for name, nodes in part} for part in master.getSystemState()
    )
    parameters = dict(_flatten("", master.getParam("/")))
    nodes = set().union(*publishers.values(), *subscribers.values(), *services.values())
    with ThreadPoolExecutor(_AT_A_TIME) as executor:
        answers = dict(zip(nodes, executor.map(_ask, nodes), strict=True))
        silent = {node: answer for node, answer in answers.items() if isinstance(answer, str)}
        pairs = [(n, t) for t, names in publishers.items() for n in names - silent.keys()]
        offers = list(executor.map(lambda pair: _offer(answers[pair[0]][0], pair[1]), pairs))
        served = {name: min(owners) for name, owners in services.items()}
        alive = [name for name, node in served.items() if node not in silent]
        headers = list(executor.map(_service_type, alive))
    connections = {
        (node, row[4], row[1])
        for node, answer in answers.items()
        if node not in silent
        for row in answer[1]
        if row[2] == "o" and row[5:6] != [False]
    }
    return Graph(
        publishers=publishers,
        subscribers=subscribers,
        services=served,
        parameters=parameters,
        silent=silent,
        topic_types={p: o for p, o in zip(pairs, offers, strict=True) if o},
        service_types={s: h for s, h in zip(alive, headers, strict=True) if h},
        connections=connections,
    )


def _flatten(prefix, tree):
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _flatten(f"{prefix}/{key}", value)
        else:
            yield f"{prefix}/{key}", value


def _ask(node: str) -> tuple[str, list[Any]] | str:
    """Return address and connections of a node; a text if it does not answer."""
    try:
        # A proxy of the master serves one thread only.
        uri = rosgraph.Master(_NAME).lookupNode(node)
        answer: Any = ServerProxy(uri).getBusInfo(_NAME)
        return uri, answer[2]
    except Exception as error:
        # Anything that listens on the port of a node that is no more.
        return str(error) or type(error).__name__


def _offer(uri: str, topic: str) -> Type | None:
    """Return the type that a publisher offers; None if it cannot be asked."""
    # Anything may listen on that port. Publishers that do not answer are found by `_ask`.
    with contextlib.suppress(Exception):
        answer: Any = ServerProxy(uri).requestTopic(_NAME, topic, [["TCPROS"]])
        _, host, port = answer[2]
        with socket.create_connection((host, port), LIMIT) as connection:
            return _handshake(connection, {"topic": topic})
    return None


def _service_type(service: str) -> Type | None:
    # Likewise.
    with contextlib.suppress(Exception):
        uri = urlsplit(rosgraph.Master(_NAME).lookupService(service))
        with socket.create_connection((uri.hostname or "", uri.port or 0), LIMIT) as connection:
            return _handshake(connection, {"service": service, "probe": "1"})
    return None


def _handshake(connection: socket.socket, fields: dict[str, str]) -> Type | None:
    header = {**fields, "md5sum": "*", "type": "*", "callerid": _NAME}
    write_ros_handshake_header(connection, header)
    answer: Mapping[str, Any] = read_ros_handshake_header(connection, io.BytesIO(), 4096)
    if "type" not in answer or "md5sum" not in answer:
        return None
    return answer["type"], answer["md5sum"]
