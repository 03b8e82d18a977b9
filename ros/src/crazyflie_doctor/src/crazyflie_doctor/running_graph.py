"""A running graph: answers of the master and the nodes, with a time limit, and a recording."""

import contextlib
import io
import os
import socket
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import urlsplit

import roslib.message
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from crazyflie_doctor.graph import Graph, Type
from crazyflie_doctor.timing import TimingRecording, Transform
from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils.main import begin
from crazyflie_utils.ros1.master_watch import bounded_master, bounded_proxy

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
    try:
        # Nodes answer what `rosgraph.is_master_online` asks, too.
        _master().getUri()
    except Exception:
        # No answer, an answer that is not a master's, or an invalid URI.
        return False
    return True


def _master():
    # One for each thread.
    return bounded_master(_NAME, LIMIT)


def graph() -> Graph:
    """Ask the master and all nodes, many at a time.

    OSError or rosgraph.MasterException: the master does not answer.
    """
    master = _master()
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
        uri = _master().lookupNode(node)
        _, _, connections = bounded_proxy(uri, LIMIT).getBusInfo(_NAME)
        return uri, connections
    except Exception as error:
        # Another program may listen on the port of a node that has ended.
        return str(error) or type(error).__name__


def _offer(uri: str, topic: str) -> Type | None:
    """Return the type that a publisher offers; None if it cannot be asked."""
    # Another program may listen on that port. `_ask` finds publishers that do not answer.
    with contextlib.suppress(Exception):
        _, _, (_, host, port) = bounded_proxy(uri, LIMIT).requestTopic(_NAME, topic, [["TCPROS"]])
        with socket.create_connection((host, port), LIMIT) as connection:
            return _handshake(connection, {"topic": topic})
    return None


def _service_type(service: str) -> Type | None:
    # Likewise.
    with contextlib.suppress(Exception):
        uri = urlsplit(_master().lookupService(service))
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


def record(graph: Graph, duration: float) -> TimingRecording:
    """Return what is published within ``duration`` seconds of the machine's clock.

    The node publishes nothing, and subscribes to topics of the graph that have a publisher.
    """
    process = begin(f"doctor_{os.getpid()}")
    handle = process.handle(f"/doctor_{os.getpid()}")
    recording = TimingRecording()

    def now():
        return handle.stamp().to_sec()

    def on_transforms(message, is_static):
        source = message._connection_header["callerid"]
        for transform in message.transforms:
            recording.transforms.append(
                Transform(
                    transform.header.frame_id.strip("/"),
                    transform.child_frame_id.strip("/"),
                    source,
                    transform.header.stamp.to_sec(),
                    now(),
                    is_static,
                )
            )

    def on_control(topic, message):
        stamp = message.header.stamp.to_sec()
        # A control without a stamp does not say how old the pose is.
        if stamp > 0.0:
            recording.delays.setdefault(topic, []).append(now() - stamp)
            recording.control_stamps.setdefault(topic, []).append(stamp)

    def on_diagnostics(message):
        source = message._connection_header["callerid"]
        for status in message.status:
            if "://" in status.hardware_id:
                recording.reported.setdefault(status.hardware_id, set()).add(source)

    def subscribe(topic, message_type, callback):
        if graph.publishers.get(topic):
            handle.subscribe(topic, message_type, callback)

    subscribe("/tf", TFMessage, lambda message: on_transforms(message, False))
    subscribe("/tf_static", TFMessage, lambda message: on_transforms(message, True))
    subscribe("/clock", Clock, lambda message: recording.clocks.append(message.clock.to_sec()))
    subscribe("/diagnostics", DiagnosticArray, on_diagnostics)
    for topic in sorted(
        {t for (_, t), (name, _) in graph.topic_types.items() if name == ControlStamped._type}
    ):
        subscribe(topic, ControlStamped, lambda message, topic=topic: on_control(topic, message))
    process.start()
    time.sleep(duration)
    process.stop()
    handle.close()
    return recording
