"""The only door between a node and ROS: roscpp's NodeHandle for Python."""

from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, TypeVar

import genpy
import rosgraph.names

from crazyflie_utils.handle_tf import TfHandle
from crazyflie_utils.handle_time import TimeHandle
from crazyflie_utils.latest import Latest
from crazyflie_utils.parameters.declaration import REQUIRED, Declaration, Parameters, read_parameter
from crazyflie_utils.parameters.types import ParameterType
from crazyflie_utils.services import Reply, pass_on, serve
from crazyflie_utils.topics import Publisher, Subscriber
from crazyflie_utils.vectors import is_finite

P = TypeVar("P", bound=Parameters)
M = TypeVar("M", bound=genpy.Message)


class NodeHandle(TimeHandle, TfHandle):
    """Names, parameters, topics, services, timers, time, tf and log of one node.

    The node's callbacks, whatever calls for them, run one at a time, and never
    at the same time as those of another node in the process. A callback that
    raises is logged once with its traceback, and the node is told so through
    `on_fault`; it will be called again.

    Parameters
    ----------
    process : Process
        What the nodes of a process share.
    name : str
        Absolute name of the node, such as /simulator.
    """

    def child(self) -> "NodeHandle":
        """Return another handle of the node, for what may be closed before the node ends.

        `close` takes down what was made through it. It may be used from any thread.
        """
        child = NodeHandle(self._process, self._name)
        child._faults = self._faults
        return child

    def close(self) -> None:
        """Take down all publishers, subscribers, services and timers of this handle.

        No callback that was registered through it begins any more.
        """
        self._is_closed = True
        while self._undo:
            self._undo.pop()()

    # Names and parameters.

    def resolve(self, name: str) -> str:
        """Return the absolute name of a topic, service or parameter.

        A relative name is in the node's namespace, ``~name`` is the node's own.
        Remappings of the launch file apply.
        """
        return self._process.transport.remap(rosgraph.names.resolve_name(name, self._name))

    def load(
        self,
        parameters: type[P],
        on_change: Callable[[P], None] | None = None,
    ) -> P:
        """Return the node's own (private) parameters, all of them checked.

        Parameters
        ----------
        parameters : type
            Subclass of `Parameters`.
        on_change : callable, optional
            Offers the live ones to dynamic_reconfigure: ``on_change(parameters)`` is
            called between two other callbacks with all of them, checked, after some
            were changed. It may raise `ParameterError` to refuse.

        Raises
        ------
        ParameterError
            About everything that is not set though required, or not what is expected.
        """
        own = self._own_parameters()

        def get(name):
            full_name = self._parameter_name(name)
            if not full_name.startswith(self._name + "/"):
                return self._process.transport.get_param(full_name)
            value = own
            for key in full_name.removeprefix(self._name + "/").split("/"):
                if not isinstance(value, dict):
                    raise KeyError(name)
                value = value[key]
            return value

        loaded = parameters.read(get, self._parameter_name)
        if on_change is not None:
            # Here, since most processes do without.
            from crazyflie_utils.parameters.reconfigure import Reconfiguration

            Reconfiguration(self, loaded, get, on_change)
        return loaded

    def _own_parameters(self):
        # In one request, however many there are.
        try:
            return self._process.transport.get_param(self._name)
        except KeyError:
            return {}

    def _parameter_name(self, name):
        return self.resolve(name if name.startswith("/") else "~" + name)

    def get_param(self, name: str, type: ParameterType, default: Any = REQUIRED) -> Any:  # noqa: A002
        """Return a parameter that cannot be declared: another's, or one of a changing name.

        Parameters
        ----------
        name : str
            A relative name is in the node's namespace, ``~name`` is the node's own.
        type : ParameterType
        default : object, optional
            Taken as it is when the parameter is not set.

        Raises
        ------
        ParameterError
            It is required but not set, or not what is expected.
        """
        declaration = Declaration(self.resolve(name), type, "", default, live=False)
        return read_parameter(declaration, self._process.transport.get_param)

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter that others may read; blocks for a few milliseconds.

        Parameters
        ----------
        name : str
            A relative name is in the node's namespace.
        value : bool, int, float, str, list or dict
            A dictionary takes the place of the whole namespace ``name``.
        """
        self._process.transport.set_param(self.resolve(name), value)

    def set_param_later(self, name: str, value: Any) -> None:
        """Do the same as `set_param` soon, without waiting for the master.

        Of several values of a parameter that wait, only the latest is set. What cannot be set is
        logged.
        """
        self._process.transport.set_param_later(self.resolve(name), value)

    # Topics and services.

    def publisher(self, topic: str, message_type: type, latch: bool = False) -> Publisher:
        """Announce a topic and return its publisher.

        With ``latch``, whoever subscribes later is sent the last message.
        """
        publisher = self._process.topics.publisher(self.resolve(topic), message_type, latch)
        self._undo.append(publisher.close)
        return publisher

    def subscribe(
        self,
        topic: str,
        message_type: type[M],
        callback: Callable[[M], None],
        finite: str = "",
        on_invalid: Callable[[], None] | None = None,
        latest_only: bool = False,
    ) -> Subscriber:
        """Have ``callback(message)`` called for every message on a topic.

        The message belongs to everybody: it must not be changed. The subscriber that is
        returned tells whether there are publishers.

        Parameters
        ----------
        topic : str
        message_type : type
        callback : callable
        finite : str, optional
            A field of the message, such as "control", whose numbers must be finite.
            Other messages are dropped with a warning, and
        on_invalid : callable, optional
            is called instead, without arguments.
        latest_only : bool, optional
            Only the latest message is delivered, before the node's next timer, which it has to
            have, or service call.
        """
        if finite:
            callback = self._finite_only(self.resolve(topic), finite, callback, on_invalid)
        guarded = self.guard(callback)
        submit, topics = self._process.executor.submit, self._process.topics
        latest = Latest(guarded)
        receive = latest.take if latest_only else lambda message: submit(partial(guarded, message))
        subscriber = topics.subscribe(self.resolve(topic), message_type, receive)
        self._undo.append(subscriber.close)
        if latest_only:
            self._to_deliver.append(latest.deliver)
        return subscriber

    def _finite_only(self, topic, field, callback, on_invalid):
        def check(message):
            if is_finite(getattr(message, field)):
                callback(message)
                return
            self.warn(f"ignoring a message on {topic}: its {field} is not finite", throttle=1.0)
            if on_invalid is not None:
                on_invalid()

        return check

    def advertise_service(
        self, name: str, service_type: type, callback: Callable[[Any], Any]
    ) -> None:
        """Answer calls of a service.

        ``callback(request)`` returns the response; or, for work that takes time, a
        `concurrent.futures.Future` of it, so that the node goes on living
        meanwhile; or raises `ServiceError` with a text for the caller.
        """

        def begin(request):
            answer: Future[Any] = Future()
            submit = self._process.executor.submit
            submit(self._deliver_latest)
            submit(partial(serve, callback, request, answer, self))
            return answer

        end = self._process.transport.advertise_service(
            self.resolve(name), service_type, begin, self._process.clock.time
        )
        self._undo.append(end)

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float
    ) -> Future[Any]:
        """Call a service of any process, without waiting for it.

        Returns
        -------
        concurrent.futures.Future
            Of the response; or of a `ServiceError` when the service refuses, is
            not there, or has not answered after ``limit`` seconds of the
            machine's clock. What is added to it with ``add_done_callback`` runs
            like any callback; none may wait for it.
        """
        outcome = Reply(self)
        reply = self._process.transport.call_service(
            self.resolve(name), service_type, request, limit
        )
        submit = self._process.executor.submit
        reply.add_done_callback(lambda reply: submit(partial(pass_on, reply, outcome, self)))
        return outcome

    def service_nodes(self) -> dict[str, str]:
        """Return every service that is offered now -> its node; blocks for a few milliseconds."""
        return self._process.transport.service_nodes()
