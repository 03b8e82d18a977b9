"""The scenes of the last minutes, to look back at."""

from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

from crazyflie_dashboard.snapshot import Scene, VehicleSnapshot
from crazyflie_utils.refusal import listed

SPAN = 600.0  #: Time that is kept (s).
_PERIOD = 0.2  #: Shortest time between two scenes that are kept (s).
#: Vehicles that are kept a second: with more than twenty of them, fewer scenes are kept.
_MAX_RATE = 100.0
_MAX_EVENTS = 200


@dataclass(frozen=True)
class Event:
    """What happened at a time (s); the level is "info", "warn" or "error"."""

    time: float
    level: str
    text: str


class History:
    """The scenes of the last `SPAN`, without log and diagnostics. For any thread."""

    def __init__(self) -> None:
        self._scenes: deque[Scene] = deque()
        self._events: deque[Event] = deque(maxlen=_MAX_EVENTS)

    def add(self, scene: Scene) -> None:
        """Keep a scene, unless the last one is recent enough."""
        scenes, period = self._scenes, max(_PERIOD, len(scene.vehicles) / _MAX_RATE)
        if scenes and scene.made - scenes[-1].made < 0.9 * period:
            return
        if scenes:
            self._events.extend(_events(scenes[-1], scene))
        while scenes and scene.made - scenes[0].made > SPAN:
            scenes.popleft()
        scenes.append(replace(scene, log=(), sentences=(), images=()))

    @property
    def events(self) -> tuple[Event, ...]:
        """What has happened, oldest first."""
        return tuple(self._events)

    @property
    def begin(self) -> float | None:
        """Time of the oldest scene (s); None without one."""
        return next((scene.made for scene in self._scenes), None)

    def at(self, time: float) -> Scene | None:
        """Return the last scene that was made by a time (s), or else the oldest one."""
        scenes = tuple(self._scenes)
        if not scenes:
            return None
        return scenes[max(bisect_right(scenes, time, key=lambda scene: scene.made) - 1, 0)]

    def of(self, name: str) -> Iterator[tuple[float, VehicleSnapshot]]:
        """Yield times (s) and snapshots of a vehicle."""
        for scene in tuple(self._scenes):
            if (snapshot := scene.vehicles.get(name)) is not None:
                yield scene.made, snapshot


def _events(before, now):
    """Return in which vehicles, missions and recording two scenes differ."""

    def having(scene, what):
        return {name for name, each in scene.vehicles.items() if getattr(each, what)}

    for what, level, begins, ends in (
        ("is_emergency", "error", "emergency of", "reset of"),
        ("is_in_flight", "info", "in flight:", "landed:"),
        ("is_battery_low", "warn", "battery low:", ""),
    ):
        old, new = having(before, what), having(now, what)
        for names, text, each in ((new - old, begins, level), (old - new, ends, "info")):
            if names and text and names <= before.vehicles.keys() & now.vehicles.keys():
                shown = [name for name in now.vehicles if name in names]
                yield Event(now.made, each, f"{text} {listed(shown)}")
    if bool(before.missions) != bool(now.missions):
        text = f"mission {now.missions[0]}" if now.missions else f"end of {before.missions[0]}"
        yield Event(now.made, "info", text)
    if before.recording != now.recording:
        yield Event(now.made, "info", now.recording or "the report is ready")
