"""Nodes registered with the master: others of the same name, and this process.

A master shuts a node down when another one of its name registers, and a master that is restarted
knows no node.
"""

import http.client
import threading
import xmlrpc.client
from typing import Any
from urllib.parse import urlsplit

import rosgraph
import rospy
from rospy.impl import registration
from typing_extensions import override

#: What a request raises if its receiver is not there, or does not understand it.
NO_ANSWER = (OSError, http.client.HTTPException, xmlrpc.client.Error, rosgraph.MasterException)

_METHODS = {
    registration.Registration.PUB: "registerPublisher",
    registration.Registration.SUB: "registerSubscriber",
    registration.Registration.SRV: "registerService",
}


def register() -> None:
    """Register all topics and services of this process with the master."""
    listeners = registration.get_registration_listeners()
    topics, services = registration.get_topic_manager(), registration.get_service_manager()
    # With publishers first, the master need not notify the subscribers that come next. Services are
    # registered in the order of their names: a program that finds a vehicle's takeoff meanwhile
    # also finds its high_level/go_to, by which it selects how to fly the vehicle.
    registered = [
        *(("pub", *each) for each in topics.get_publications()),
        *(("sub", *each) for each in topics.get_subscriptions()),
        *(("srv", *each) for each in sorted(services.get_services())),
    ]
    request: Any = xmlrpc.client.MultiCall(rospy.core.xmlrpcapi(rosgraph.get_master_uri()))
    for kind, name, type_or_uri in registered:
        getattr(request, _METHODS[kind])(rospy.get_name(), name, type_or_uri, rospy.get_node_uri())
    try:
        outcome: Any = request()
        answers = [outcome[k] for k in range(len(registered))]
    except NO_ANSWER:
        # One by one, each repeated until the master answers.
        for kind, name, type_or_uri in registered:
            listeners.notify_added(name, type_or_uri, kind)
        return
    for (kind, name, _), (code, text, uris) in zip(registered, answers, strict=True):
        if code != 1:
            rospy.logfatal(f"unable to register {name} with master: {text}")
        elif kind == "sub":
            # rospy checks all topics of the process at each update.
            subscription = topics.subs.get(name)
            missing = [uri for uri in uris if subscription and not subscription.has_connection(uri)]
            if missing:
                update_publishers(name, missing)


def update_publishers(topic: str, uris: list[str]) -> None:
    """Connect the subscribers of a topic to publishers, in a thread of rospy."""
    for listener in registration.get_registration_listeners().listeners:
        listener.publisher_update(topic, uris)


_PERIOD = 2.0  #: Period at which the master is asked whether it knows this process (s).
_ANSWER_LIMIT = 3.0  #: Time after which a node that does not answer is dead (s).


class _BoundedTransport(xmlrpc.client.Transport):
    def __init__(self, limit: float):
        super().__init__()
        self._limit = limit

    @override
    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = self._limit
        return connection


def bounded_proxy(uri: str, limit: float) -> Any:
    """Return a proxy, for one thread, of a master or node; ``limit`` is that of an answer (s)."""
    return xmlrpc.client.ServerProxy(uri, transport=_BoundedTransport(limit))


def bounded_master(caller: str, limit: float) -> rosgraph.Master:
    """Return the master, as it answers a node; see `bounded_proxy`."""
    master = rosgraph.Master(caller)
    master.handle = bounded_proxy(master.master_uri, limit)
    return master


def master_answers(limit: float = _ANSWER_LIMIT) -> bool:
    """Return whether the master answers within ``limit`` (s); one that is stopped does not."""
    try:
        bounded_master("/master_answers", limit).getPid()
    except (*NO_ANSWER, ValueError):
        return False
    return True


def living_node(name: str) -> str | None:
    """Return the place of a node, such as "process 12 on HOST", if it is registered and answers."""
    caller = rospy.get_name()
    try:
        uri = rosgraph.Master(caller).lookupNode(name)
        node = bounded_proxy(uri, _ANSWER_LIMIT)
        _, _, pid = node.getPid(caller)
    except NO_ANSWER:
        return None
    try:
        _, _, answers_as = node.getName(caller)
    except (*NO_ANSWER, ValueError):
        # Only nodes in Python can say their names.
        answers_as = name
    # The port of a node that has died may be that of another one by now.
    return f"process {pid} on {urlsplit(uri).hostname}" if answers_as == name else None


def namesake(names: set[str]) -> str | None:
    """Return which node of these names is running, with the remedy; None without any."""
    try:
        registrations = rosgraph.Master(rospy.get_name()).getSystemState()
    except NO_ANSWER:
        # The master has just ended; the registration waits for a new one.
        return None
    registered = {node for kind in registrations for _, nodes in kind for node in nodes}
    for name in sorted(names & registered):
        place = living_node(name)
        if place is not None:
            return (
                f"{name} runs already: {place}. It goes on, and this process ends; end the other "
                "one or its launch first, or start this one under another name or namespace"
            )
    return None


class MasterWatch:
    """Registers this process again with a master that has forgotten it.

    Connections between nodes need no master, so that a flight continues without it.
    """

    def __init__(self) -> None:
        self._master = rosgraph.Master(rospy.get_name())
        self._end = threading.Event()
        self._was_there = True
        self._pid: int | None = None

    def start(self) -> None:
        """Start the watch in a thread of its own: a master may be frozen."""
        threading.Thread(target=self._run, name="master watch", daemon=True).start()

    def stop(self) -> None:
        """End."""
        self._end.set()

    def look(self) -> None:
        """Ask the master once, and register with it if it does not know this process."""
        try:
            is_known = True
            try:
                self._master.lookupNode(rospy.get_name())
            except rosgraph.MasterError:
                is_known = False
            pid = self._pid if is_known and self._pid is not None else self._master.getPid()
        except NO_ANSWER:
            if self._was_there:
                rospy.logwarn("the ROS master does not answer; existing connections continue")
            self._was_there = False
            return
        self._was_there = True
        # A process that ends removes its registrations, while this thread may still ask.
        if not is_known and not self._end.is_set() and not rospy.core.is_shutdown_requested():
            if self._pid in (None, pid):
                rospy.logwarn("the ROS master does not know this node any more; registering again")
            else:
                rospy.logwarn("the ROS master was restarted; registering with it")
            register()
        self._pid = pid

    def _run(self):
        while not self._end.wait(_PERIOD):
            self.look()
