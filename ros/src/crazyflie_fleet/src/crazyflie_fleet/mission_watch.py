"""The running missions, their vehicles, and missions that end while their vehicles fly."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from std_msgs.msg import String

from crazyflie_utils import NodeHandle

#: Topic of missions: their name, the vehicles in flight, and after a bar all their vehicles; a
#: mission that ends publishes its name alone.
MISSION_TOPIC = "/all/mission"
MISSION_PERIOD = 0.5  #: Period of these messages (s of the machine's clock).
#: Time without a message after which a mission has died (s of the machine's clock).
MISSION_TIMEOUT = 5.0


class Claim(NamedTuple):
    """A message of a mission: the names of its vehicles."""

    flying: Sequence[str]
    vehicles: Sequence[str]

    def message(self, mission: str) -> String:
        """Return the message of a mission."""
        return String(" ".join([mission, *self.flying, "|", *self.vehicles]))


class MissionWatch:
    """The running missions, except ``own``; a mission that has died has no vehicles any more.

    ``on_lost(names)`` gets the vehicles that flew by the last message of a mission that has died.
    """

    def __init__(
        self,
        handle: NodeHandle,
        on_lost: Callable[[Sequence[str]], None] = lambda names: None,
        own: str = "",
    ):
        self._on_lost = on_lost
        self._own = own
        #: Vehicles of the running missions, by the missions' names.
        self.claims: dict[str, Claim] = {}
        self.heard: set[str] = set()  #: Names of missions, also of those that have ended.
        # Ticks since the last message, so that a suspended computer does not lose missions.
        self._ticks: dict[str, int] = {}
        handle.subscribe(MISSION_TOPIC, String, self._on_mission)
        handle.timer(MISSION_PERIOD, self._on_timer, steady=True)

    def _on_mission(self, message):
        mission, *rest = message.data.split() or [""]
        if mission == self._own:
            return
        self.heard.add(mission)
        if not rest:
            self._forget(mission)
            return
        bar = rest.index("|") if "|" in rest else len(rest)
        flying = rest[:bar]
        self.claims[mission] = Claim(flying, rest[bar + 1 :] or flying)
        self._ticks[mission] = 0

    def _forget(self, mission):
        self._ticks.pop(mission, None)
        return self.claims.pop(mission, Claim((), ()))

    def _on_timer(self):
        for mission in [*self._ticks]:
            self._ticks[mission] += 1
            if self._ticks[mission] * MISSION_PERIOD > MISSION_TIMEOUT:
                flying = self._forget(mission).flying
                if flying:
                    self._on_lost(flying)
