"""A process without ROS, for unit tests: parameters in a dict, time moved by hand."""

import time
from concurrent.futures import Future
from typing import Any

import genpy
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import ReconfigureRequest
from typing_extensions import override

from crazyflie_utils.node import Node
from crazyflie_utils.offline_process import OfflineProcess, pass_time
from crazyflie_utils.testing.fake_transport import FakeTransport
from crazyflie_utils.timers import Executor, TimerQueue


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
        # The timeouts of calls are not timers of the process.
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
        self.transport.deliver(topic, message)

    def published(self, topic: str) -> list[genpy.Message]:
        """Return all messages that left the process on a topic, oldest first."""
        return self.transport.published(topic)

    def call(self, service: str, request: genpy.Message) -> genpy.Message | Future[genpy.Message]:
        """Call a service from outside; `ServiceError` if it refuses.

        The response is a future if the service takes time; `advance` lets the time pass.
        """
        return self.transport.call(service, request)

    def reconfigure(self, node: str, **values: object) -> genpy.Message | Future[genpy.Message]:
        """Change parameters of a node as dynamic_reconfigure does; see `call`."""
        return self.call(f"{node}/set_parameters", ReconfigureRequest(encode_config(values)))

    def logged(self, level: str) -> list[str]:
        """Return the texts logged at a level, oldest first."""
        return [text for logged_at, text in self.transport.log_records if logged_at == level]

    @override
    def machine_time(self) -> float:
        # A test without a journal finds a throttled warning once, however long it flies.
        return super().machine_time() if self.recorder is not None else time.monotonic()

    def advance_machine(self, duration: float) -> None:
        """Advance the machine's clock (s), while simulated time is not published."""
        machine = self.machine_clock
        pass_time(duration, machine.time, self._machine_deadline, self.set_machine_clock)

    @override
    def _machine_deadline(self) -> float:
        return min(super()._machine_deadline(), self.transport.machine_timers.next_deadline())
