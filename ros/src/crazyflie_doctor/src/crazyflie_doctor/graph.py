"""Checks of a graph: nodes, message types, connections, publishers."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from crazyflie_doctor.finding import Finding, error, listed, warn
from crazyflie_link.address import Address
from crazyflie_link.errors import AddressError

Type = tuple[str, str]  #: Name and MD5 sum of a message or service type.

CONTROLS = {
    "crazyflie_msgs/ControlStamped",
    "crazyflie_msgs/NoYawControlStamped",
    "crazyflie_msgs/PrioritizedControlStamped",
    "geometry_msgs/Twist",
}
STATES_AND_REFERENCES = {
    "crazyflie_msgs/FullStateStamped",
    "crazyflie_msgs/PositionVelocityStateStamped",
    "crazyflie_msgs/PositionVelocityYawStateStamped",
}

COMPLEMENTARY = 1  #: Number of the firmware's estimator that knows no position.

#: Optional inputs of nodes, by the ends of their parameters' names.
_OPTIONAL = {"prioritized_control"}

_BUILD = "build the workspace again (./run build), source it in every shell, and restart the nodes"


@dataclass(frozen=True)
class Graph:
    """The graph as master and nodes report it."""

    #: publishers, subscribers: Topic -> names of nodes.
    publishers: Mapping[str, set[str]] = field(default_factory=dict)
    subscribers: Mapping[str, set[str]] = field(default_factory=dict)
    services: Mapping[str, str] = field(default_factory=dict)  #: Service -> name of its node.
    #: Full name -> value; no dictionaries.
    parameters: Mapping[str, Any] = field(default_factory=dict)
    silent: Mapping[str, str] = field(default_factory=dict)  #: Node that does not answer -> why.
    #: (node, topic) -> the `Type` that this publisher offers.
    topic_types: Mapping[tuple[str, str], Type] = field(default_factory=dict)
    service_types: Mapping[str, Type] = field(default_factory=dict)  #: Service -> `Type`.
    #: (publisher, topic, subscriber) that are connected.
    connections: set[tuple[str, str, str]] = field(default_factory=set)

    @property
    def topics(self) -> dict[str, set[str]]:
        """Topic named by a parameter such as /lqr_controller/topics/state -> such parameters."""
        named = defaultdict(set)
        for name, value in self.parameters.items():
            if "/topics/" in name and isinstance(value, str):
                named["/" + value.strip("/")].add(name)
        return dict(named)

    @property
    def uris(self) -> dict[str, list[str]]:
        """Address of a vehicle, in one of its spellings -> parameters that name it."""
        return _by_vehicle(
            (value, name)
            for name, value in sorted(self.parameters.items())
            if name.endswith("/uri") and isinstance(value, str) and "://" in value
        )


def _by_vehicle(named: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the names of pairs of an address and a name, by the first spelling of the address."""
    spellings: dict[str, str] = {}
    names: dict[str, list[str]] = {}
    for uri, name in named:
        try:
            key = Address.parse(uri).key
        except AddressError:
            key = uri
        names.setdefault(spellings.setdefault(key, uri), []).append(name)
    return names


def check_nodes(graph: Graph) -> Iterator[Finding]:
    """Find nodes that the master knows but that do not answer."""
    for node, why in sorted(graph.silent.items()):
        yield error(
            f"{node} does not answer ({why})",
            "dead: rosnode cleanup, and launch it again; on another computer: see ROS_IP there; "
            "frozen: kill it",
        )


def check_types(graph: Graph, ours: Callable[[str, str], str | None]) -> Iterator[Finding]:
    """Compare the types of all publishers and services with those of this workspace.

    ``ours(kind, type name)`` returns the MD5 sum of the type here, None if it is unknown here; the
    kind is "msg" or "srv".
    """
    for (node, topic), offered in sorted(graph.topic_types.items()):
        yield from _compare(f"{node} publishes {topic}", offered, ours("msg", offered[0]))
    for service, offered in sorted(graph.service_types.items()):
        node = graph.services[service]
        yield from _compare(f"{node} offers {service}", offered, ours("srv", offered[0]))
    by_topic = defaultdict(set)
    for (_, topic), offered in graph.topic_types.items():
        by_topic[topic].add(offered)
    for topic, types in sorted(by_topic.items()):
        if len({name for name, _ in types}) > 1:
            yield error(
                f"{topic} has publishers of {listed(name for name, _ in types)}",
                "rename one of the topics",
            )


def _compare(what, offered, own):
    name, md5 = offered
    if own is None:
        yield warn(f"{what} as {name}, which is unknown here", "source the workspace that has it")
    elif own != md5:
        yield error(f"{what} as {name} with MD5 {md5}, here it is {own}", _BUILD)


def check_connections(graph: Graph) -> Iterator[Finding]:
    """Find subscribers that are not connected with a publisher of their topic."""
    for topic, publishers in sorted(graph.publishers.items()):
        for publisher in sorted(publishers - graph.silent.keys()):
            missing = {
                subscriber
                for subscriber in graph.subscribers.get(topic, set()) - graph.silent.keys()
                if subscriber != publisher
                and (publisher, topic, subscriber) not in graph.connections
            }
            if missing:
                yield error(
                    f"{listed(missing)} is not connected to {publisher} on {topic}",
                    "message types differ, or one cannot reach the other's ROS_IP: see its log; "
                    + _BUILD,
                )


def check_publishers(graph: Graph) -> Iterator[Finding]:
    """Find topics without a publisher, and controls and references from two sources."""
    for topic, parameters in sorted(graph.topics.items()):
        listeners = graph.subscribers.get(topic, set())
        if listeners and not graph.publishers.get(topic):
            is_optional = {name.rpartition("/")[2] for name in parameters} <= _OPTIONAL
            yield (warn if is_optional else error)(
                f"{topic} has no publisher, {listed(listeners)} waits for it",
                f"launch the node that publishes it, or correct {listed(parameters)}",
            )
    if graph.subscribers.get("/tf") and not graph.publishers.get("/tf"):
        yield error("no node publishes /tf", "start the simulator or mocap_optitrack")
    yield from _doubled(graph)


def _doubled(graph):
    references = {
        topic
        for topic, names in graph.topics.items()
        if any(name.endswith("/reference") for name in names)
    }
    by_topic = {topic: name for (_, topic), (name, _) in graph.topic_types.items()}
    for topic, publishers in sorted(graph.publishers.items()):
        if len(publishers) < 2:
            continue
        if topic in references:
            servers = publishers & _takeoff_servers(graph, topic)
            others = publishers - servers
            # A takeoff server hands the vehicle to one other node between takeoff and landing.
            doubled = others if len(servers) == 1 else publishers
            if len(doubled) > 1:
                yield warn(
                    f"the reference {topic} comes from {listed(doubled)}",
                    "end all but one: the vehicle jumps between them",
                )
        elif by_topic.get(topic) in CONTROLS | STATES_AND_REFERENCES:
            yield error(
                f"{topic} comes from {listed(publishers)}",
                "end all but one: each overrides the other",
            )


def _takeoff_servers(graph, reference):
    """Return the nodes that publish the references of descents, too."""
    topics = {f"{reference}_descent"}
    for name, value in graph.parameters.items():
        node, _, key = name.rpartition("/topics/")
        if key == "descent_reference" and f"{node}/topics/reference" in graph.topics[reference]:
            topics.add("/" + str(value).strip("/"))
    return {node for topic in topics for node in graph.publishers.get(topic, ())}


def check_estimators(graph: Graph) -> Iterator[Finding]:
    """Find vehicles that are sent poses which their estimator ignores."""
    end = "/stabilizer/estimator"
    for name, value in sorted(graph.parameters.items()):
        if not name.endswith(end) or value != COMPLEMENTARY:
            continue
        prefix = name.removesuffix(end)
        for topic in (f"{prefix}/external_pose", f"{prefix}/external_position"):
            if graph.publishers.get(topic):
                yield error(
                    f"the estimator of {prefix or '/'} ignores {topic}: {name} is {COMPLEMENTARY} "
                    "(complementary)",
                    "set it to 2 (Kalman), by the launch file or update_params",
                )


def check_drivers(graph: Graph, reported: Mapping[str, set[str]]) -> Iterator[Finding]:
    """Find vehicles that several drivers, or several launches, have been told to fly.

    ``reported`` is address of a vehicle -> nodes whose diagnostics have it.
    """
    pairs = ((uri, node) for uri in sorted(reported) for node in reported[uri])
    for uri, nodes in _by_vehicle(pairs).items():
        if len({*nodes}) > 1:
            yield error(f"{uri} is flown by {listed(nodes)}", "end all but one driver")
    for uri, parameters in graph.uris.items():
        if len(parameters) > 1:
            yield error(
                f"{uri} is added by {listed(name.rpartition('/')[0] for name in parameters)}",
                "give each vehicle its own uri; rosparam delete what an earlier launch has left",
            )
