"""The bar under the scene: the last minutes, and which moment of them is shown."""

from collections.abc import Sequence
from typing import Any

from nicegui.elements.mixins.value_element import ValueElement
from nicegui.events import GenericEventArguments

from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.progress import Stage
from crazyflie_dashboard.snapshot import Scene, Step

STEP = 5.0  #: Steps in which the length of the bar grows (s).
LEVELS = {Stage.REFUSED: "error", Stage.ENDED: "warn"}


class TimeBar(ValueElement, component="timebar.js"):  # type: ignore[call-arg]
    """The bar; the value is what `refresh` puts together."""

    VALUE_PROP = "bar"

    def __init__(self, session: Session) -> None:
        super().__init__(value=_bar(0.0, None, [], "", "", []))
        self._session = session
        self.on("seek", self._seek, throttle=0.1)

    def refresh(self, now: float, live: Scene) -> None:
        """Show the time that is kept until ``now``, time.monotonic() (s)."""
        dashboard = self._session.dashboard
        begin, past = dashboard.begin(), self._session.past
        kept = 0.0 if begin is None else STEP * round((now - begin) / STEP)
        marks = [(each.time, each.level, each.text) for each in dashboard.events()]
        marks += [
            (row.begun, LEVELS.get(row.stage, "info"), f"{row.text}: {row.outcome}")
            for row in dashboard.progress()
        ]
        # Rounded: a mark that moves all the time would be sent all the time.
        events = [[STEP * round((now - at) / STEP), level, text] for at, level, text in marks]
        ago = None if past is None else round(now - past, 1)
        mission, recording = " · ".join(live.missions), live.recorded or live.recording
        self.value = _bar(kept, ago, events, mission, recording, live.steps)

    def _seek(self, event: GenericEventArguments) -> None:
        self._session.look_back(event.args)


def _bar(
    kept: float,
    ago: float | None,
    events: Sequence[Any],
    mission: str,
    recording: str,
    steps: Sequence[Step],
) -> dict[str, Any]:
    return {
        "kept": kept,
        "ago": ago,
        "events": events,
        "mission": mission,
        "recording": recording,
        "steps": [list(step) for step in steps],
    }
