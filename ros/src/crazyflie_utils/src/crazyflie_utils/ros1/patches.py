"""All changes of rospy's behaviour: a table, and the functions that apply them.

The changes are to objects that handles own: their topics, and the process's server and clock.
rospy's modules and classes, and topics that are subscribed or published by rospy alone, stay as
they are. If a target is not the code for which a patch was written, or the environment variable
CRAZYFLIE_ROSPY_PATCHES ("all", "none" or names such as "send_at_once,connect_once") disables the
patch, rospy's own code runs, and one line is logged.

The figures of single messages and topics were measured in November 2026; those of flights are of
``./run bench cpu start simulated``. Each is with CRAZYFLIE_ROSPY_PATCHES set or not.
"""

import contextlib
import functools
import importlib
import logging
import os
from collections.abc import Iterator
from dataclasses import dataclass

import genpy
import rospy
from rospy import rostime
from rospy.impl import paramserver, registration, simtime, tcpros_base

from crazyflie_utils.ros1 import master_watch
from crazyflie_utils.ros1.own_topics import OwnPublication, OwnSubscription
from crazyflie_utils.ros1.receiving import MAX_PENDING, Acceptor, Report
from crazyflie_utils.topics import Condition

_NO_TOPICS = "/rosout_disable_topics_generation"

ROSOUT = "rosout"  #: The logger behind rospy.loginfo and its like.


class Shielded(logging.Handler):
    """Passes records to another handler, and handles its errors as Python's own handlers do.

    rospy's handler, which writes to the screen, does not. Under roslaunch the "screen" may be a
    file.
    """

    def __init__(self, handler: logging.Handler) -> None:
        super().__init__(handler.level)
        self._handler = handler

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record by the other handler."""
        try:
            self._handler.emit(record)
        except OSError:
            self.handleError(record)


def shield_screen_log() -> None:
    """Put a `Shielded` around each handler of rospy's logger, once."""
    logger = logging.getLogger(ROSOUT)
    for handler in list(logger.handlers):
        if not isinstance(handler, Shielded):
            logger.removeHandler(handler)
            logger.addHandler(Shielded(handler))


def log_without_master() -> None:
    """Read the parameter with which rospy leaves topics out of /rosout, once; by default it does.

    rospy does not cache a parameter that is not set: it asked the master at each line, and waited
    for a frozen one even in an emergency. In a process of 100 vehicles, the names of all topics
    made a line take 2 ms, so that lines of all vehicles at once caused a gap in their control.
    """
    value = True
    # A master that has just ended does not block the process.
    with contextlib.suppress(OSError):
        value = rospy.get_param(_NO_TOPICS, True)
    paramserver.get_param_server_cache().set(_NO_TOPICS, value)


SWITCH = "CRAZYFLIE_ROSPY_PATCHES"

_TOPICS = "rospy.topics:"
_TCP = "rospy.impl.tcpros_base:"


@dataclass(frozen=True)
class Patch:
    """A change of rospy."""

    without: str  #: Text for the log about behaviour without the patch.
    #: "module:Class.function" to its parameters and, behind a colon, names that its code uses.
    targets: dict[str, str]


#: Above each: what rospy does, what it does with the patch, and why; figures without -> with the
#: patch, measured on a machine with other load. Tested with rospy 1.15.15.
PATCHES = {
    # A subscriber connects to the publisher of its own process by a socket. With the patch, handles
    # hand messages over by a call; what came by the connection would be dropped.
    # Publish to a subscriber in the process: 6.7 -> 1.5 us of CPU, 44 -> 4 us until it returns.
    "skip_self_connections": Patch(
        "messages between nodes of this process go through a socket as well",
        {
            f"{_TOPICS}_SubscriberImpl.has_connection": "self endpoint_id: connections",
            f"{_TOPICS}_SubscriberImpl.add_callback": "self cb cb_args: callbacks",
        },
    ),
    # Each report of a publisher by the master makes a connection, and the last one stays. With the
    # patch, the first one stays: subscriber and publisher may disagree about which came last, and
    # would then close both, so that nothing is received any more.
    "connect_once": Patch(
        "a subscriber may miss a publisher that starts at the same moment",
        {f"{_TOPICS}_SubscriberImpl.add_connection": "self c: connections c_lock endpoint_id"},
    ),
    # Every message is decoded; if that fails, rospy reconnects for ever. With the patch, an invalid
    # message is dropped and logged once; a flood is decoded in part, so that control continues
    # (docs/faults.md, Peers).
    "harden_subscribers": Patch(
        "publishers that send invalid messages, or floods, delay the nodes of this process",
        {
            f"{_TCP}TCPROSTransport.receive_once": "self: read_buff protocol is_latched latch",
            f"{_TCP}TCPROSTransport._validate_header": "self header: callerid_pub is_latched",
            f"{_TOPICS}_SubscriberImpl.add_connection": "self c: connections c_lock",
        },
    ),
    # Each subscriber has a thread, which is woken up for each message. With the patch, the
    # publisher's thread sends, unless the subscriber does not keep up.
    # To another process and back: 143 -> 97 us of CPU, 0.8 -> 0.2 ms.
    "send_at_once": Patch(
        "sending takes a thread for each subscriber",
        {
            f"{_TOPICS}_PublisherImpl.add_connection": "self c: queue_size latch publock",
            f"{_TOPICS}_PublisherImpl.set_queue_size": "self queue_size: queue_size",
            f"{_TOPICS}_PublisherImpl.publish": "self message connection_override: connections seq",
            f"{_TOPICS}_PublisherImpl.close": "self: publock buff",
        },
    ),
    # Headers of connections are read one after the other, without a limit of time. With the patch,
    # each in a thread, within 5 s: otherwise a silent peer would delay /emergency (docs/faults.md,
    # Peers).
    "harden_tcp_server": Patch(
        "a peer that connects and says nothing blocks all others",
        {
            f"{_TCP}TCPROSServer._tcp_server_callback": "self sock client_addr: "
            "topic_connection_handler service_connection_handler",
            f"{_TCP}TCPROSServer.start_server": "self: tcp_ros_server _tcp_server_callback",
        },
    ),
    # Each topic and service is registered by a request of its own. With the patch, all of the
    # starting nodes are registered in one request, when all nodes are complete.
    # Announce a topic: 2.8 -> 0.5 ms, 0.25 -> 0.04 ms of CPU.
    "register_together": Patch(
        "nodes register their topics and services one by one",
        {
            "rospy.impl.registration:RegistrationListeners.notify_added": "self resolved_name "
            "data_type reg_type: listeners"
        },
    ),
    # rospy's clock listens to /clock, also in the process that publishes it. With the patch, the
    # process sets it by a call, when it sets its own: 36 -> 59 s of simulated time per s of CPU.
    "set_own_clock": Patch(
        "the clock of this process's log goes through a socket",
        {"rospy.rostime:_set_rostime": "t: Time notifyAll"},
    ),
}


def _fits(target: str, expected: str) -> bool:
    """Return whether a function has the expected parameters and uses the expected names."""
    module, _, path = target.partition(":")
    parameters, _, names = expected.partition(":")
    try:
        function = functools.reduce(getattr, path.split("."), importlib.import_module(module))
        code = function.__code__
    except (ImportError, AttributeError):
        return False
    # A name may be used in a nested function.
    known = {*code.co_names, *code.co_varnames}
    return code.co_varnames[: code.co_argcount] == tuple(parameters.split()) and known >= set(
        names.split()
    )


@functools.cache
def active() -> frozenset[str]:
    """Return the names of the active patches; environment and rospy are inspected once."""
    wanted = os.environ.get(SWITCH, "all")
    names = set(PATCHES) if wanted == "all" else set(wanted.split(",")) - {"none", ""}
    for unknown in sorted(names - set(PATCHES)):
        rospy.logwarn(
            f"{SWITCH}: unknown patch {unknown}; expected all, none or {', '.join(PATCHES)}"
        )
    on = set()
    for name, patch in PATCHES.items():
        misfits = [each for each, expected in patch.targets.items() if not _fits(each, expected)]
        if name in names and not misfits:
            on.add(name)
        elif name in names:
            rospy.logwarn(
                f"this rospy differs from the tested one: {patch.without} "
                f"({', '.join(misfits)} changed)"
            )
        else:
            rospy.loginfo(f"{SWITCH} disables {name}: {patch.without}")
    return frozenset(on)


def own_subscription(
    name: str,
    message_type: type,
    is_handed_over: Condition,
    report: Report,
    limits_rate: bool,
) -> None:
    """Create rospy's side of a topic that a handle is about to subscribe to, unless it exists."""
    if {"skip_self_connections", "connect_once", "harden_subscribers"} & active():
        manager = registration.get_topic_manager()
        with manager.lock:
            if name not in manager.subs:
                own = OwnSubscription(
                    name, message_type, is_handed_over, report, limits_rate, active()
                )
                manager._add(own, manager.subs, registration.Registration.SUB)


def own_publication(name: str, message_type: type, queue_size: int, latch: bool) -> None:
    """Create rospy's side of a topic that a handle is about to publish, unless it exists."""
    if "send_at_once" in active():
        manager = registration.get_topic_manager()
        with manager.lock:
            if name not in manager.pubs:
                own = OwnPublication(name, message_type, queue_size, latch)
                manager._add(own, manager.pubs, registration.Registration.PUB)


def harden_tcp_server(report: Report) -> None:
    """Make the process's server answer each connection in a thread of its own."""
    server = tcpros_base._tcpros_server
    is_done = server is None or isinstance(server._tcp_server_callback, Acceptor)
    if is_done or "harden_tcp_server" not in active():
        return
    server._tcp_server_callback = Acceptor(server, report)
    if server.tcp_ros_server is not None:
        # The server keeps the method with which it was started, and queues five connections: those
        # beyond them try again after a second or two.
        server.tcp_ros_server.inbound_handler = server._tcp_server_callback
        server.tcp_ros_server.server_sock.listen(MAX_PENDING)


@contextlib.contextmanager
def registering_together() -> Iterator[None]:
    """Register all topics and services of a with block at its end; none if the block raises."""
    if "register_together" not in active():
        yield
        return
    listeners = registration.get_registration_listeners()
    # By then they are in rospy's tables, which `register` reads.
    listeners.notify_added = lambda *_: None
    try:
        yield
    finally:
        del listeners.notify_added
    master_watch.register()


def take_over_clock() -> bool:
    """Unsubscribe rospy's clock from /clock; return whether `set_clock` is to set it."""
    if "set_own_clock" not in active():
        return False
    subscriber = getattr(simtime, "_clock_sub", None)
    if subscriber is not None:
        subscriber.unregister()
    return True


def set_clock(stamp: genpy.Time) -> None:
    """Set rospy's simulated clock, where `take_over_clock` has returned true."""
    moment = rospy.Time.__new__(rospy.Time)
    moment.secs, moment.nsecs = stamp.secs, stamp.nsecs
    rostime._rostime_current = moment
    # rospy notifies every time, which takes several times as long as the rest of this function.
    if rostime._rostime_cond._waiters:
        rostime._set_rostime(moment)
