"""The world outside a process, for unit tests."""

from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from typing import Any

from typing_extensions import override

from crazyflie_utils.offline_transport import OfflineTransport
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.steps import copy_outcome
from crazyflie_utils.timers import TimerQueue


class FakeTransport(OfflineTransport):
    """An outside world with other processes, and services that may not answer in time.

    ``foreign_services`` are those of other processes, name -> node; ``dead_nodes`` do not answer.
    """

    machine_timers: TimerQueue  #: They limit the duration of service calls; set by `FakeProcess`.

    def __init__(self, parameters: dict[str, object]):
        super().__init__(parameters)
        self.foreign_services: dict[str, str] = {}
        self.dead_nodes: set[str] = set()

    @override
    def call_service(
        self, name: str, service_type: type, request: Any, limit: float, start_limit: float
    ) -> Future[Any]:
        answer = self.find_service(name)(request)
        if answer.done():
            return answer
        reply: Future[Any] = Future()

        def give_up() -> None:
            answer.cancel()
            with suppress(InvalidStateError):
                reply.set_exception(ServiceError(f"{name} has not answered within {limit:g} s"))

        timer = self.machine_timers.add(limit, give_up)
        reply.add_done_callback(lambda _: timer.stop())
        answer.add_done_callback(lambda _: copy_outcome(answer, reply))
        return reply

    @override
    def service_nodes(self) -> dict[str, str]:
        return super().service_nodes() | self.foreign_services

    @override
    def living_node(self, name: str) -> str | None:
        lives = name in self.foreign_services.values() and name not in self.dead_nodes
        return "process 1 on elsewhere" if lives else None

    @override
    def log(self, level: str, text: str) -> None:
        """Keep the record; pytest shows errors below a test that fails."""
        super().log(level, text)
        if level in ("error", "fatal"):
            print(f"[{level.upper()}] {text}")
