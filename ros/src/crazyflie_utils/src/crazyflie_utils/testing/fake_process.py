"""A process without ROS, for unit tests: parameters in a dict, time moved by hand."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import genpy
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import ReconfigureRequest

from crazyflie_utils.node import Node
from crazyflie_utils.offline_process import OfflineProcess
from crazyflie_utils.testing.fake_transport import FakeTransport
from crazyflie_utils.timers import Executor, TimerQueue

#: Period at which a timer of period 0 fires here (s); on a real machine it fires as often as
#: possible.
_SHORTEST_PERIOD = 1e-4


class FakeProcess(OfflineProcess):
    """A process for tests.

    The parameters are full name to raw value, such as {"/simulator/time_step": 0.01}; a
    ``transport`` replaces one with these parameters. `advance` moves both clocks,
    `advance_machine` and ``set_clock`` one of them. A ``recorder`` writes the journal.
    """

    transport: FakeTransport

    def __init__(
        self,
        parameters: dict[str, object] | None = None,
        start: float = 100.0,
        transport: FakeTransport | None = None,
        recorder: Any = None,
    ):
        fake = transport or FakeTransport(parameters or {})
        super().__init__(fake, start, recorder)
        # The timeouts of calls are no timers of the process.
        apart = Executor()
        apart.start()
        timers = fake.machine_timers = TimerQueue(apart, self.machine_clock)
        self.machine_clock.on_change(lambda now, _: timers.run_due(now))

    def launch(self, node: Node, name: str, parameters: dict[str, object] | None = None) -> bool:
        """Initialize a node with private parameters; return what ``node.initialize`` returned."""
        for key, value in (parameters or {}).items():
            self.transport.parameters[f"{name}/{key}"] = value
        return self.initialize(node, name)

    def publish(self, topic: str, message: genpy.Message) -> None:
        """Publish from outside the process."""
        for deliver in _named(self.transport.subscribers, topic, "subscriber of"):
            deliver(message)

    def published(self, topic: str) -> list[genpy.Message]:
        """Return all messages that left the process on a topic, oldest first."""
        return _named(self.transport.publishers, topic, "publisher of").messages

    def call(self, service: str, request: genpy.Message) -> genpy.Message | Future[genpy.Message]:
        """Call a service from outside; `ServiceError` if it refuses.

        The response is a future if the service takes time; `advance` lets the time pass.
        """
        answer = _named(self.transport.services, service, "service")(request)
        return answer.result() if answer.done() else answer

    def reconfigure(self, node: str, **values: object) -> genpy.Message | Future[genpy.Message]:
        """Change parameters of a node as dynamic_reconfigure does; see `call`."""
        return self.call(f"{node}/set_parameters", ReconfigureRequest(encode_config(values)))

    def logged(self, level: str) -> list[str]:
        """Return the texts logged at a level, oldest first."""
        return [text for logged_at, text in self.transport.log_records if logged_at == level]

    def advance(self, duration: float) -> None:
        """Advance both clocks (s), with a stop at every timer's deadline."""
        pass_time(duration, self.clock.time, self.next_deadline, self.move_to)

    def advance_machine(self, duration: float) -> None:
        """Advance the machine's clock (s), while simulated time is not published."""
        machine = self.machine_clock
        pass_time(duration, machine.time, self._machine_deadline, self.set_machine_clock)

    def _machine_deadline(self):
        calls = self.transport.machine_timers
        return min(self._steady.next_deadline(), calls.next_deadline())

    def next_deadline(self) -> float:
        """Return the time at which the next timer of either clock is due, in simulated time (s)."""
        ahead = self.machine_clock.time() - self.clock.time()
        return min(self._simulated.next_deadline(), self._machine_deadline() - ahead)

    def move_to(self, moment: float) -> None:
        """Move both clocks, at once, until simulated time is ``moment`` (s)."""
        ahead = self.machine_clock.time() - self.clock.time()
        self.set_clock(moment)
        self.set_machine_clock(moment + ahead)


def pass_time(
    duration: float,
    time: Callable[[], float],
    next_deadline: Callable[[], float],
    move_to: Callable[[float], None],
) -> None:
    """Advance ``time()`` by a duration (s), with a stop at each deadline."""
    end = time() + duration
    while time() < end:
        deadline = next_deadline()
        if deadline <= time():
            deadline = time() + _SHORTEST_PERIOD
        # A deadline may be past the end by a rounding error, which is not a step back.
        move_to(deadline if deadline < end + 1e-9 else end)


def _named(things, name, kind):
    try:
        return things[name]
    except KeyError:
        raise KeyError(f"there is no {kind} {name}; known: {sorted(things)}") from None
