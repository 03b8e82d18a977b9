"""Sentences of the doctor and of diagnostics, and the log."""

import re
import time

from nicegui import ui
from nicegui.elements.mixins.value_element import ValueElement

from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.snapshot import LogLine, Scene

LEVELS = ("debug", "info", "warn", "error", "fatal")
_COMMAND = re.compile(r"page \d+: ")  #: Begin of the dashboard's lines about commands.
MAX_LINES = 200  #: Lines of the log that are shown, the newest first.


class Lines(ValueElement, component="lines.js"):  # type: ignore[call-arg]
    """Lines: the value has key, style, source, text, and remedy of each."""

    VALUE_PROP = "lines"

    def __init__(self, nothing: str) -> None:
        super().__init__(value=[])
        self._props["nothing"] = nothing


class MessagesPanel:
    """Findings with remedies, and /rosout with the vehicles' consoles by level."""

    def __init__(self, session: Session):
        self._session = session
        with ui.element("div").classes("tools"):
            ui.label("Problems").classes("choice")
            self._examine = ui.button("Ask the doctor", on_click=self._ask).props("outline dense")
        self._sentences = Lines("Diagnostics and the doctor report nothing; the log is below.")
        with ui.element("div").classes("tools apart"):
            ui.label("Log").classes("choice")
            self._level = ui.select(list(LEVELS), value="info", label="level")
            self._level.props("dense outlined options-dense").classes("level")
            self._filter = ui.input("contains").props("dense outlined clearable").classes("number")
            ui.button("Export", on_click=self._export).props("outline dense")
        self._log = Lines("No message of this level yet.")

    def refresh(self, scene: Scene) -> None:
        """Show the newest messages."""
        self._sentences.value = [
            [str(number), each.level, f"{each.level}  {each.source}", each.text, each.remedy]
            for number, each in enumerate(scene.sentences)
        ]
        shown = LEVELS[LEVELS.index(self._level.value) :]
        part = (self._filter.value or "").lower()
        lines: dict[tuple[str, str, object], list[LogLine]] = {}
        for line in reversed(scene.log):
            if line.level in shown and part in f"{line.node} {line.text}".lower():
                # A command is a line of its own, also if it was given twice.
                same = line.number if _COMMAND.match(line.text) else line.text
                lines.setdefault((line.level, line.node, same), []).append(line)
        self._log.value = [_shown(each) for each in [*lines.values()][:MAX_LINES]]

    def _export(self) -> None:
        """Let the browser keep the whole log, oldest first."""
        rows = (
            f"{line.time:.3f}\t{line.level}\t{line.node}\t{' '.join(line.text.split())}\n"
            for line in self._session.dashboard.scene().log
        )
        ui.download.content("time, s\tlevel\tnode\ttext\n" + "".join(rows), "messages.tsv")

    async def _ask(self) -> None:
        self._examine.disable()
        if await self._session.succeeds(self._session.dashboard.examine()):
            self._session.say("The doctor has finished.", "positive")
        self._examine.enable()


def _shown(lines: list[LogLine]) -> list[object]:
    """Return the newest of lines with the same text, and their number."""
    line, count = lines[0], len(lines)
    often = f", {count} times since {_clock(lines[-1].time)}" if count > 1 else ""
    head = f"{line.level}  {_clock(line.time)}  {line.node}{often}"
    return [line.number, line.level, head, line.text, ""]


def _clock(seconds: float) -> str:
    """Return ROS time as a text: time of day, or s of simulated time."""
    is_simulated = seconds < 1e9
    return f"{seconds:.1f} s" if is_simulated else time.strftime("%X", time.localtime(seconds))
