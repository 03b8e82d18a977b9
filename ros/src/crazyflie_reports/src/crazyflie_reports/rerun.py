"""Nodes run again, in a process without ROS, on what was recorded: in open or in closed loop."""

import contextlib
import heapq
import math
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from operator import itemgetter
from typing import Any

import genpy
import numpy as np
from geometry_msgs.msg import Quaternion, Vector3
from rosgraph_msgs.msg import Log
from std_msgs.msg import Header

from crazyflie_reports.bag_topics import role_of, row_of
from crazyflie_reports.flight_input import COMPOSED, FlightInput, Given, InputError
from crazyflie_reports.flown_model import FlownModel
from crazyflie_utils.node import Node
from crazyflie_utils.offline_process import OfflineProcess
from crazyflie_utils.offline_transport import OfflineTransport
from crazyflie_utils.program import load_recorded, missing_module

TF, _ROSOUT = "/tf", "/rosout"
_LEVELS = {"debug": Log.DEBUG, "info": Log.INFO, "warn": Log.WARN, "error": Log.ERROR}
_APART = "/what_if"  # Namespace of the controls that do not reach the nodes by themselves.
_SAME = 5e-6  # Largest difference of times that are the same (s).
_LONGEST_PAUSE = 600.0  # Between two messages, s.
_OTHER_CLOCK = 10.0  # Age of a stamp above which it is of another clock (s).


@dataclass
class Interface:
    """What a node does with ROS, as it is found by initializing it."""

    publishes: dict[str, Any]  #: Types by topic.
    subscribes: dict[str, Any]
    parameters: set[str]  #: Full names of all parameters that it reads.

    @property
    def topics(self) -> set[str]:
        """All of its topics."""
        return {*self.publishes, *self.subscribes}


def interface(name: str, given: FlightInput) -> Interface:
    """Return the interface of a node, by its absolute name.

    `InputError`: there is no such class, or it cannot be initialized with these parameters.
    """
    transport = OfflineTransport(given.parameters)
    transport.remappings = given.remappings
    process = OfflineProcess(transport, 0.0)
    if not process.initialize(_make(name, given.classes[name]), name):
        raise InputError(_errors(transport))
    own = {each for each in transport.names if each.startswith(f"{name}/")}
    own -= {*transport.services, *transport.publishers, *transport.subscribers}
    return Interface(transport.publisher_types, transport.subscriber_types, own)


def remove_effects(given: FlightInput) -> None:
    """Remove nodes that would act on more than messages, such as a driver on its vehicles."""
    for name, path in list(given.classes.items()):
        # One that is not there any more may not be chosen.
        with contextlib.suppress(InputError):
            if effects := _class(name, path).effects:
                del given.classes[name]
                given.remarks.append(f"{name} is not run again: it acts on {effects}")


def _make(name, path):
    made = _class(name, path)
    if made.effects:
        raise InputError(f"the node {name} acts on {made.effects}: it is not run again")
    return made()


def _class(name, path):
    try:
        made = load_recorded(path)
        if isinstance(made, type) and issubclass(made, Node):
            return made
        reason = "it is not a class derived from Node"
    except (ImportError, AttributeError, ValueError, TypeError) as error:
        reason = missing_module(error) or str(error)
    raise InputError(f"the node {name} cannot be made from {path}: {reason}")


def _errors(transport):
    return "\n".join(text for level, text in transport.log_records if level in ("error", "fatal"))


@dataclass
class Sent:
    """Messages of a run, in their order: time (s), topic, message."""

    #: published: What the nodes sent. delivered: What they were given, the model's poses included.
    published: list[tuple[float, str, genpy.Message]] = field(default_factory=list)
    delivered: list[tuple[float, str, genpy.Message]] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)  #: Calls that a node has refused, and why.
    errors: list[str] = field(default_factory=list)  #: Errors that nodes have logged.


class Rerun:
    """Nodes that get what a recording has for them; `run` runs them, once.

    Messages that the nodes publish themselves are not taken from the recording.
    """

    def __init__(self, given: FlightInput, interfaces: dict[str, Interface]):
        self._given = given
        self._own = {topic for each in interfaces.values() for topic in each.publishes}
        # The process has a clock of its own.
        self._read = {t for each in interfaces.values() for t in each.subscribes} - {"/clock"}
        self._callers = {*interfaces, COMPOSED}
        self._senders: dict[str, set[str]] = defaultdict(set)  # Nodes by topic.
        for given_message in given.messages:
            self._senders[given_message.topic].add(given_message.caller)
        #: cut: The controls of the nodes that fly the vehicle. command: What flies it, which is
        #: these or, with a driver, cmd_vel. None: no node publishes them, or a simulator is among
        #: the nodes, which reads them.
        self.cut = None if TF in self._own else _topic_of(interfaces, "final_control")
        self.command = self.cut and (_topic_of(interfaces, "cmd_vel") or self.cut)
        times = np.array([each.time for each in given.messages])
        if (pause := float(np.diff(times).max(initial=0.0))) > _LONGEST_PAUSE:
            raise InputError(
                f"two messages are {pause:.0f} s apart; expected at most {_LONGEST_PAUSE:g} s: was "
                "the clock set, or are there several flights?"
            )
        self._start = max(0.0, self._find_start(interfaces))
        self._sent = Sent()
        self._model: FlownModel | None = None
        self._since = math.inf
        self._frame = ""
        self._measured: dict[int, Any] = {}  # Poses of the model by stamp (ns).
        self._headers: dict[tuple[str, str], dict[str, str]] = {}
        transport = self._transport = OfflineTransport(given.parameters)
        self._process = OfflineProcess(transport, 0.0)
        self._process.clock.wall_offset = self._start
        transport.on_publish, transport.on_log = self._on_publish, self._on_log
        for name, each in interfaces.items():
            # Otherwise, in open loop, an estimator would take the new controls for those that flew.
            is_apart = self.cut is not None and self.cut in each.publishes
            apart = {str(self.cut): f"{_APART}{self.cut}"} if is_apart else {}
            transport.remappings = given.remappings | apart
            if not self._process.initialize(_make(name, given.classes[name]), name):
                raise InputError(_errors(transport))
        transport.unpublished = self._read - {each.topic for each in given.messages}

    def fly(self, model: FlownModel, since: float, frame: str) -> None:
        """Let a model fly by the nodes' controls from a time (s) on.

        Its poses come at the times, and with the stamps, of those of the ``frame`` that were
        recorded.
        """
        self._model, self._since, self._frame = model, since, frame

    def run(self, end: float) -> Sent:
        """Run the nodes until a time (s)."""
        messages = ((each.time, 1, partial(self._deliver, each)) for each in self._given.messages)
        calls = ((call[0], 0, partial(self._call, *call)) for call in self._given.calls)
        for time, _, event in heapq.merge(
            messages, calls, self._measurements(), key=itemgetter(0, 1)
        ):
            if time > end:
                break
            self._advance_to(time - _SAME)
            event()
        self._advance_to(end)
        self._sent.errors = [
            text for level, text in self._transport.log_records if level in ("error", "fatal")
        ]
        return self._sent

    def last_warning(self) -> str:
        """Return the last text that a node has logged as a warning or an error."""
        levels = ("warn", "error", "fatal")
        texts = [text for level, text in self._transport.log_records if level in levels]
        return texts[-1] if texts else "it has said nothing"

    def _find_start(self, interfaces):
        """Return a time before the first message from which timers are due when they were then.

        States are published by the timers whose phase matters.
        """
        first = self._given.messages[0].time
        for name, each in interfaces.items():
            topic = _topic_of({name: each}, "state")
            times = np.array([given.time for given in self._given.messages if given.topic == topic])
            period = self._given.parameters.get(f"{name}/time_step")
            if len(times) and isinstance(period, float) and period > 0.0:
                angles = (times - first) * (2.0 * math.pi / period)
                mean = math.atan2(float(np.sin(angles).mean()), float(np.cos(angles).mean()))
                return first - period + mean * period / (2.0 * math.pi)
        return first

    def _advance_to(self, time):
        self._process.advance(max(0.0, time - self._start - self._process.clock.time()))

    def _is_flown(self, time):
        return self._model is not None and time >= self._since

    def _on_publish(self, topic, message):
        now, name = self._start + self._process.clock.time(), topic.removeprefix(_APART)
        self._sent.published.append((now, name, message))
        model = self._model
        if model is None or now < self._since:
            return
        if topic != name and name in self._transport.subscribers:
            self._transport.deliver(name, message)
        if name == self.command:
            model.advance_to(now)
            model.command(row_of(name, message), now)

    def _on_log(self, level, text):
        # As rospy publishes it; the text begins with the node's name.
        now = self._start + self._process.clock.time()
        header, name = Header(stamp=genpy.Time.from_sec(now)), text.partition(":")[0]
        line = Log(header=header, level=_LEVELS.get(level, Log.FATAL), name=name, msg=text)
        self._sent.published.append((now, _ROSOUT, line))

    def _deliver(self, given):
        topic, is_flown = given.topic, self._is_flown(given.time)
        if self.is_own(given):
            # The timers that have led to it came before the messages behind it.
            self._advance_to(given.time + _SAME)
            if topic != self.cut:
                return
        if topic not in self._read or (topic == self.cut and is_flown):
            return
        message = given.message()
        if given.caller:
            key = given.caller, topic
            header = self._headers.setdefault(key, {"callerid": given.caller, "topic": topic})
            message._connection_header = header
        if topic == TF and is_flown:
            for transform in message.transforms:
                self._set_pose(transform)
        self._sent.delivered.append((given.time, topic, message))
        self._transport.deliver(topic, message)

    def is_own(self, given: Given) -> bool:
        """Return whether one of the nodes publishes such a message now, in place of a recorded one.

        References may come from outside as well: they are the nodes' own where the recording tells
        senders apart. rosbag in Python writes the first sender of a topic for all.
        """
        if given.topic == _ROSOUT:
            return given.message().name in self._callers
        if given.topic not in self._own:
            return False
        found = role_of(given.topic, given.message_type._type, {})
        if found is not None and found[1].name == "reference":
            return len(self._senders[given.topic]) > 1 and given.caller in self._callers
        return not given.caller or given.caller in self._callers

    def _call(self, time, service, request):
        serve = self._transport.services.get(service)
        if serve is None:
            return

        def note(answer):
            if answer.exception() is not None:
                self._sent.refusals.append(f"{service}: {answer.exception()}")

        serve(request).add_done_callback(note)

    def _measurements(self):
        """Return when the model's poses are measured: at the stamps of the recorded ones."""
        found: list[tuple[float, int, Callable[[], None]]] = []
        model = self._model
        if model is None:
            return found

        def measure(time, stamp):
            self._measured[stamp] = model.pose(time)

        for each in self._given.messages:
            if each.topic != TF or not self._is_flown(each.time):
                continue
            for transform in each.message().transforms:
                if transform.child_frame_id.strip("/") == self._frame:
                    stamp = transform.header.stamp.to_nsec()
                    is_known = 0.0 <= each.time - stamp * 1e-9 < _OTHER_CLOCK
                    time = max(stamp * 1e-9, self._since) if is_known else each.time
                    found.append((time, 0, partial(measure, time, stamp)))
        return sorted(found, key=itemgetter(0))

    def _set_pose(self, transform):
        if transform.child_frame_id.strip("/") == self._frame:
            position, rotation = self._measured.pop(transform.header.stamp.to_nsec())
            transform.transform.translation = Vector3(*position)
            transform.transform.rotation = Quaternion(*rotation)


def _topic_of(interfaces, role):
    """Return the topic of a role that a node publishes, or None."""
    for each in interfaces.values():
        for topic, message_type in each.publishes.items():
            found = role_of(topic, message_type._type, {})
            if found is not None and found[1].name == role:
                return topic
    return None
