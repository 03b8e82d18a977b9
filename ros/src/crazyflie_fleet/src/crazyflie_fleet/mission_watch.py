"""Detects missions that end while their vehicles fly."""

from collections.abc import Callable

from std_msgs.msg import String

from crazyflie_utils import NodeHandle

#: Published by missions in flight: their name, and the names of the vehicles in flight.
MISSION_TOPIC = "/all/mission"
MISSION_PERIOD = 0.5  #: Between two of these messages, s of the machine's clock.
#: A mission without a message for so long has died, s of the machine's clock.
MISSION_TIMEOUT = 5.0


class MissionWatch:
    """Watchdog of missions: ``on_lost(names)`` gets the vehicles of a mission's last message."""

    def __init__(self, handle: NodeHandle, on_lost: Callable[[list[str]], None]):
        self._on_lost = on_lost
        self._vehicles: dict[str, list[str]] = {}
        # Ticks since the last message, so that a suspended computer does not lose missions.
        self._ticks: dict[str, int] = {}
        handle.subscribe(MISSION_TOPIC, String, self._on_mission)
        handle.timer(MISSION_PERIOD, self._on_timer, steady=True)

    def _on_mission(self, message):
        mission, *names = message.data.split() or [""]
        self._vehicles[mission], self._ticks[mission] = names, 0
        if not names:
            self._forget(mission)

    def _forget(self, mission):
        del self._ticks[mission]
        return self._vehicles.pop(mission)

    def _on_timer(self):
        for mission in [*self._ticks]:
            self._ticks[mission] += 1
            if self._ticks[mission] * MISSION_PERIOD > MISSION_TIMEOUT:
                self._on_lost(self._forget(mission))
