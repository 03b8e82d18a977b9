"""The recordings, with their reports, and comparisons of two."""

from urllib.parse import urlencode

from nicegui import ui

from crazyflie_dashboard.page.session import Session, allow
from crazyflie_dashboard.recording import Recorded
from crazyflie_dashboard.snapshot import Scene
from crazyflie_utils.refusal import listed

COLUMNS = ("begin", "length", "size", "vehicles", "report")


class RecordingsPanel:
    """A table of the recordings; one or two that are selected become a report."""

    def __init__(self, session: Session):
        self._session = session
        self._recordings: tuple[Recorded, ...] = ()
        self._recording = ""
        with ui.element("div").classes("tools"):
            self._count = ui.label().classes("choice")
            self._make = ui.button("Report", on_click=self._show).props("outline dense")
        ui.label("Select one, or two to compare them on one page.").classes("hint")
        self._table = ui.table(
            columns=[
                {"name": name, "label": name, "field": name, "align": "left", "sortable": True}
                for name in COLUMNS
            ],
            rows=[],
            row_key="begin",
            selection="multiple",
        ).props("dense flat wrap-cells hide-selected-banner")
        self._table.props('no-data-label="No flight has been recorded yet."')
        self.list_files()

    def list_files(self) -> None:
        """Show the recordings that there are now."""
        self._recordings = self._session.dashboard.recordings()
        self._table.rows = [row(each) for each in self._recordings]

    def refresh(self, scene: Scene) -> None:
        """Follow a recording that ends, and say what the button does."""
        if scene.recording != self._recording:
            self._recording = scene.recording
            self.list_files()
        count = len(self._table.selected)
        noun = "recording" if len(self._recordings) == 1 else "recordings"
        self._count.text = f"{len(self._recordings)} {noun}"
        self._make.text = "Compare" if count == 2 else "Report"
        allow(self._make, "" if 1 <= count <= 2 else "select one recording, or two")

    async def _show(self) -> None:
        names = tuple(each["begin"] for each in self._table.selected)
        self._make.props(add="loading")
        dashboard, result = self._session.dashboard, True
        if dashboard.report(names) is None:
            result = await self._session.succeeds(dashboard.make_report(names))
        self._make.props(remove="loading")
        if result:
            self.list_files()
            self._session.show_report(urlencode([("of", name) for name in names]))


def row(recording: Recorded) -> dict[str, str]:
    """Return a row of the table."""
    minutes, seconds = divmod(round(recording.length), 60)
    return {
        "begin": recording.name,
        "length": f"{minutes}:{seconds:02}",
        "size": f"{recording.size / 1e6:.1f} MB",
        "vehicles": listed(recording.vehicles),
        "report": "yes" if recording.has_report else "",
    }
