"""What the doctor and the diagnostics say, and the log."""

import time

from nicegui import ui

from crazyflie_dashboard.page.component import Lines
from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.snapshot import Scene

LEVELS = ("debug", "info", "warn", "error", "fatal")
MAX_LINES = 200  #: Lines of the log that are shown, the newest first.


class MessagesPanel:
    """Sentences with what to do, and /rosout with the vehicles' consoles by level."""

    def __init__(self, session: Session):
        self._session = session
        with ui.element("div").classes("tools"):
            ui.label("What is not as it should be").classes("choice")
            self._examine = ui.button("Ask the doctor", on_click=self._ask).props("outline dense")
        self._sentences = Lines("Nothing is reported.")
        with ui.element("div").classes("tools apart"):
            ui.label("Log").classes("choice")
            self._level = ui.select(list(LEVELS), value="info", label="level")
            self._level.props("dense outlined options-dense").classes("level")
            self._filter = ui.input("contains").props("dense outlined clearable").classes("number")
        self._log = Lines("No message of this level yet.")

    def refresh(self, scene: Scene) -> None:
        """Show the newest ones."""
        self._sentences.show(
            [
                [str(number), each.level, each.source, each.text, each.remedy]
                for number, each in enumerate(scene.sentences)
            ]
        )
        shown = LEVELS[LEVELS.index(self._level.value) :]
        part = (self._filter.value or "").lower()
        lines = [
            [line.number, line.level, f"{_clock(line.time)}  {line.node}", line.text, ""]
            for line in reversed(scene.log)
            if line.level in shown and part in f"{line.node} {line.text}".lower()
        ]
        self._log.show(lines[:MAX_LINES])

    async def _ask(self) -> None:
        self._examine.disable()
        if await self._session.succeeds(self._session.dashboard.examine()):
            self._session.say("The doctor has looked at everything.", "positive")
        self._examine.enable()


def _clock(seconds: float) -> str:
    """Return ROS time as a text: time of day, or s of simulated time."""
    is_simulated = seconds < 1e9
    return f"{seconds:.1f} s" if is_simulated else time.strftime("%X", time.localtime(seconds))
