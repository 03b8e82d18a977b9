"""All that is touched of rospy without being offered by it (seen in rospy 1.15 to 1.17).

Each of these is needed because a process may hold many nodes, which rospy does
not provide for. The rostests of this package notice when a rospy differs.
"""

import contextlib
import functools
import http.client
import resource
import threading
import weakref
import xmlrpc.client
from collections.abc import Callable, Hashable, Iterator
from typing import Any

import genpy
import rosgraph.roslogging
import rospy
from rospy import rostime
from rospy.impl import registration, tcpros_base

_HEADER_LIMIT = 5.0
"""How long, in s, who connects may take to say what for."""

_CHECKED_AT_ONCE = 100
"""Topics; most processes have fewer."""

_MOST_NEWCOMERS = 32
"""Connections that have not said yet what for."""

Report = Callable[[str, Hashable], None]
"""``report(text, key)`` takes note of what a peer did wrong; the key is that of the kind."""


@functools.cache
def never_connect_to_oneself() -> None:
    """Keep rospy from connecting a process's subscribers to its own publishers.

    Such messages are handed over within the process; over a socket every one
    would come twice.
    """
    implementation = rospy.topics._SubscriberImpl
    has_connection = implementation.has_connection

    def has_connection_or_is_own(self, endpoint_id):
        return endpoint_id == rospy.get_node_uri() or has_connection(self, endpoint_id)

    implementation.has_connection = has_connection_or_is_own


def allow_many_topics() -> None:
    """Let this process have as many files open as the system lets it.

    rospy holds one for each topic, and a shell allows 1024 unless told otherwise: too few for
    forty vehicles.
    """
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    # Where it is refused, a process with few topics does not need it.
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


@functools.cache
def check_topics_in_turns() -> None:
    """Look for subscribers that have hung up at no more than 100 topics at a time.

    rospy does so at all of them every half second, which takes milliseconds where a process flies
    a fleet. Whoever publishes notices it anyway.
    """

    def check_some(self):
        with self.lock:
            topics = [*self.pubs.values(), *self.subs.values()]
        start = getattr(self, "checked", 0) % max(len(topics), 1)
        self.checked = start + _CHECKED_AT_ONCE
        for topic in topics[start : self.checked]:
            topic.check()

    rospy.topics._TopicManager.check_all = check_some


@functools.cache
def connect_once() -> None:
    """Connect to a publisher of a topic once, however often the master tells of it meanwhile.

    rospy makes a connection for each time. The subscriber then keeps the one it made last, the
    publisher the one that came last; where these are not the same, both are closed and nothing is
    heard any more.
    """
    connect = registration.RegManager._connect_topic_thread
    turns: weakref.WeakValueDictionary[tuple[str, str], Any] = weakref.WeakValueDictionary()
    guard = threading.Lock()

    def connect_in_turn(self, topic, uri):
        with guard:
            turn = turns.setdefault((topic, uri), threading.Lock())
        # Whoever comes second finds the connection.
        with turn:
            connect(self, topic, uri)

    registration.RegManager._connect_topic_thread = connect_in_turn


@functools.cache
def never_fail_to_log() -> None:
    """Keep a full disk, or a screen that is gone, from failing whoever logs.

    Python's own handlers do so; rospy's, for the screen, does not.
    """
    handler = rosgraph.roslogging.RosStreamHandler
    emit = handler.emit

    def emit_if_possible(self, record):
        with contextlib.suppress(OSError):
            emit(self, record)

    handler.emit = emit_if_possible


@functools.cache
def take_over_remappings() -> dict[str, str]:
    """Return the launch file's remappings, absolute name to absolute name.

    rospy no longer applies them: it would remap a name that has been remapped
    already, which goes wrong when two names are exchanged.
    """
    table = rospy.names.get_resolved_mappings()
    remappings = dict(table)
    table.clear()
    return remappings


def set_time(stamp: genpy.Time) -> None:
    """Set rospy's simulated clock, which stamps the log."""
    time = rospy.Time.__new__(rospy.Time)
    time.secs, time.nsecs = stamp.secs, stamp.nsecs
    rostime._rostime_current = time
    # Hardly ever does anybody sleep by it, and then not without looking at it now and then.
    if rostime._rostime_cond._waiters:
        rostime._set_rostime(time)


@contextlib.contextmanager
def registering_together() -> Iterator[None]:
    """Register what is announced in a with block at its end, in one request.

    One after the other, each takes milliseconds. If the block raises, nobody hears of it.
    """
    listeners = registration.get_registration_listeners()
    # What is announced is in rospy's tables by then, from where `register` takes it.
    listeners.notify_added = lambda *_: None
    try:
        yield
    finally:
        del listeners.notify_added
    register()


def register() -> None:
    """Register all topics and services of this process with the master."""
    listeners = registration.get_registration_listeners()
    topics, services = registration.get_topic_manager(), registration.get_service_manager()
    kinds = registration.Registration
    # Of publishers who come first, the master need not tell the subscribers who come then.
    registered = [
        *((kinds.PUB, *each) for each in topics.get_publications()),
        *((kinds.SUB, *each) for each in topics.get_subscriptions()),
        *((kinds.SRV, *each) for each in services.get_services()),
    ]
    methods = {
        kinds.PUB: "registerPublisher",
        kinds.SUB: "registerSubscriber",
        kinds.SRV: "registerService",
    }
    request: Any = xmlrpc.client.MultiCall(rospy.core.xmlrpcapi(rosgraph.get_master_uri()))
    for kind, name, type_or_uri in registered:
        getattr(request, methods[kind])(rospy.get_name(), name, type_or_uri, rospy.get_node_uri())
    try:
        outcome: Any = request()
        answers = [outcome[k] for k in range(len(registered))]
    except (OSError, http.client.HTTPException, xmlrpc.client.Error):
        # One by one, and each until the master is there.
        for kind, name, type_or_uri in registered:
            listeners.notify_added(name, type_or_uri, kind)
        return
    for (kind, name, _), (code, text, uris) in zip(registered, answers, strict=True):
        if code != 1:
            rospy.logfatal(f"unable to register {name} with master: {text}")
        elif kind == kinds.SUB and set(uris) - {rospy.get_node_uri()}:
            for listener in listeners.listeners:
                listener.publisher_update(name, uris)


@functools.cache
def bear_hostile_newcomers(report: Report) -> None:
    """Let nobody who connects to this process, and then is silent or talks nonsense, delay others.

    rospy reads what they want one after the other, without a limit of time.
    """
    handler = tcpros_base.TCPROSServer._tcp_server_callback
    read_header = tcpros_base.read_ros_handshake_header
    places = threading.BoundedSemaphore(_MOST_NEWCOMERS)

    def answer(self, sock, address):
        try:
            handler(self, sock, address)
        finally:
            places.release()

    def answer_in_a_thread(self, sock, address):
        if places.acquire(blocking=False):
            threading.Thread(target=answer, args=(self, sock, address), daemon=True).start()
        else:
            sock.close()

    def read_header_in_time(sock, buffer, size):
        before = sock.gettimeout()
        sock.settimeout(_HEADER_LIMIT)
        try:
            return read_header(sock, buffer, size)
        finally:
            sock.settimeout(before)

    def warn(text, *arguments):
        text = (text % arguments if arguments else text)[:300]
        report(text, ("newcomer", text))

    tcpros_base.TCPROSServer._tcp_server_callback = answer_in_a_thread
    server = tcpros_base._tcpros_server
    if server is not None and server.tcp_ros_server is not None:
        # It holds the method that it was started with.
        server.tcp_ros_server.inbound_handler = server._tcp_server_callback
        # rospy keeps five waiting. Those beyond them try again a second later, or two.
        server.tcp_ros_server.server_sock.listen(_MOST_NEWCOMERS)
    tcpros_base.read_ros_handshake_header = read_header_in_time
    tcpros_base.logwarn = warn
