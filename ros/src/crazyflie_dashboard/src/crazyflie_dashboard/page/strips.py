"""The strips over the scene: what becomes of the last commands."""

from dataclasses import replace
from typing import Any

from nicegui.elements.mixins.value_element import ValueElement
from nicegui.events import GenericEventArguments

from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.progress import Progress, Stage

SHOWN = (
    12.0  #: Time for which a command that has ended is shown; the last one that failed stays (s).
)
MOST = 4  #: Largest number of strips.


class Strips(ValueElement, component="strips.js"):  # type: ignore[call-arg]
    """A strip for each command; the value is a list of what `strip` returns."""

    VALUE_PROP = "strips"

    def __init__(self, session: Session) -> None:
        super().__init__(value=[])
        self._session = session
        self._dismissed = 0  # Number up to which commands that have ended are not shown.
        self.on("retry", self._retry)
        self.on("dismiss", self._dismiss)

    def refresh(self, now: float, obstacle: str) -> None:
        """Show the present state of the commands; ``now`` is time.monotonic() (s)."""
        rows = self._session.dashboard.progress()
        last = rows[-1].number if rows else 0
        shown = [row for row in rows if self._is_shown(row, now, last)][-MOST:]
        self.value = [strip(row, obstacle) for row in shown]

    def _is_shown(self, row: Progress, now: float, last: int) -> bool:
        if row.is_open:
            return True
        has_failed = row.stage is not Stage.DONE
        is_new = now - row.changed < SHOWN or (has_failed and row.number == last)
        return is_new and row.number > self._dismissed

    def _dismiss(self, event: GenericEventArguments) -> None:
        self._dismissed = max(self._dismissed, event.args)
        self.value = [each for each in self.value if each["number"] != event.args]

    async def _retry(self, event: GenericEventArguments) -> None:
        rows = self._session.dashboard.progress()
        for row in rows:
            if row.number == event.args["number"] and row.command is not None:
                self._dismissed = row.number
                again = replace(row.command, clicked=event.args["clicked"])
                await self._session.send(again)


def strip(row: Progress, obstacle: str) -> dict[str, Any]:
    """Return the data that strips.js shows of a command."""
    is_failed = row.stage in (Stage.REFUSED, Stage.ENDED)
    return {
        "number": row.number,
        "stage": row.word,
        "look": row.stage.name.lower(),
        "text": row.text,
        "detail": row.detail,
        "reasons": list(row.reasons),
        "retry": is_failed and not obstacle and row.command is not None,
        "closes": not row.is_open,
    }
