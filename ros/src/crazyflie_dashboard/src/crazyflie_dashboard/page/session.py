"""One open page: its number, its chosen vehicles, and its requests."""

import asyncio
import json
import time
from collections.abc import Callable, Iterable, MutableMapping
from concurrent.futures import Future
from typing import Any, TypeVar

from nicegui import Client, app, ui

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.page_data import Command
from crazyflie_dashboard.snapshot import Action, Scene, VehicleSnapshot
from crazyflie_utils.refusal import RefusalError

#: Handler in the browser that sends the time of a click; see head.html.
CLICKED = "(event) => emit(clickTime(event))"
WARNING = "color=warning text-color=dark"  #: Look of buttons that end something.
MAX_PLOTTED = 8  #: Largest number of vehicles whose plots are shown.
REFUSAL_TIME = 12000  #: Time for which a refusal is shown, ms.

Result = TypeVar("Result")


def allow(button: ui.button, why: str) -> None:
    """Enable a button, or say why it cannot be pressed."""
    button.set_enabled(not why)
    if button.props.get("title", "") != why:
        button.props["title"] = why


class Session:
    """One page that is open."""

    def __init__(self, dashboard: Dashboard, client: Client):
        self.dashboard = dashboard
        #: Its number; 0 while it has no connection. A page that connects again is a new one.
        self.page = 0
        self.chosen: set[str] = set()  #: Names of the vehicles that its buttons command.
        self.watched: str | None = None  #: The vehicle that was chosen last.
        #: The moment that the page shows, by time.monotonic() (s); None for the present.
        self.past: float | None = None
        self.on_seek: Callable[[], None] = lambda: None  #: Called when it has changed.
        #: Called once, when the page is connected, with what it had before it was loaded again.
        self.on_restore: list[Callable[[dict[str, Any]], None]] = []
        self._received: tuple[int, tuple[str, ...]] = (0, ())
        self._client = client
        asked = client.request.query_params.get("vehicles", "")
        self._asked = tuple(filter(None, asked.split(",")))
        client.on_connect(self._connect)
        client.on_disconnect(self._disconnect)
        client.on_delete(self._disconnect)

    def _connect(self) -> None:
        self._disconnect()
        loop = asyncio.get_running_loop()

        def tell(text: str) -> None:
            loop.call_soon_threadsafe(self.say, text, "warning")

        restore, self.on_restore = self.on_restore, []
        # A connection that comes back may bring clicks that have waited: it has no control.
        tab = self._client.tab_id if restore else None
        self.page = self.dashboard.pages.open(tell, tab or "")
        if restore:
            kept = dict(self._kept())
            self.chosen, self.watched = set(kept.get("chosen", self._asked)), kept.get("watched")
            if self.chosen:
                self.show_in_address(vehicles=self.chosen)
            for each in restore:
                each(kept)
        self.watch_plotted()

    def look_back(self, ago: float | None) -> None:
        """Show the moment some time ago (s), or the present."""
        self.past = None if ago is None else time.monotonic() - ago
        self.on_seek()

    def scene(self) -> Scene:
        """Return the scene of the moment that is shown."""
        past = None if self.past is None else self.dashboard.scene_at(self.past)
        return self.dashboard.scene() if past is None else past

    @property
    def plotted(self) -> tuple[str, ...]:
        """The vehicles whose plots are shown: those that are chosen, or the last one that was."""
        return self.chosen_names[:MAX_PLOTTED] or ((self.watched,) if self.watched else ())

    def watch_plotted(self) -> None:
        """Have the plots received; vehicles that were chosen before a reload may come later."""
        plotted = self.page, self.plotted
        if self.page and plotted != self._received:
            self._received = plotted
            self.dashboard.watch(*plotted)

    def keep(self, **values: Any) -> None:
        """Keep values, by name, until the page is loaded again in its tab."""
        if self._client.has_socket_connection:
            self._kept().update(values)

    def _kept(self) -> MutableMapping[str, Any]:
        with self._client:
            return app.storage.tab

    def _disconnect(self) -> None:
        page, self.page = self.page, 0
        if page:
            self.dashboard.pages.close(page)

    def say(self, text: str, kind: str = "info") -> None:
        """Show a text for a while: "positive", "info", "warning" or "negative"."""
        timeout = REFUSAL_TIME if kind in ("negative", "warning") else 5000
        with self._client:
            ui.notify(text, type=kind, position="top-left", timeout=timeout, close_button="close")

    def show_report(self, query: str = "") -> None:
        """Offer a report; by default that on the last recording."""
        # It comes late: the page can be used beside it.
        with self._client, ui.dialog().props("seamless position=left") as dialog, ui.card():
            ui.label("The report is ready.")
            ui.link("Open the report", f"/report?{query}", new_tab=True).classes("report")
            ui.button("Close", on_click=dialog.close).props("flat")
        dialog.open()

    @property
    def vehicles(self) -> dict[str, VehicleSnapshot]:
        """All vehicles, by name."""
        return dict(self.dashboard.scene().vehicles)

    @property
    def chosen_names(self) -> tuple[str, ...]:
        """Names of the chosen vehicles that are still there, in the order of the cards."""
        return tuple(name for name in self.vehicles if name in self.chosen)

    def choose(self, names: Iterable[str], is_added: bool = False) -> None:
        """Choose vehicles; with ``is_added`` toggle the choice of these and leave the others."""
        names = list(names)
        self.chosen = self.chosen ^ set(names) if is_added else set(names)
        if names:
            self.watched = names[-1]
        self.watch_plotted()
        self.keep(chosen=sorted(self.chosen), watched=self.watched)
        self.show_in_address(vehicles=self.chosen_names)

    def show_in_address(self, **lists: Iterable[str]) -> None:
        """Put lists of words into the address of the page, which can be kept and sent."""
        words = {name: ",".join(each) for name, each in lists.items()}
        if self._client.has_socket_connection:
            self._client.run_javascript(f"setAddress({json.dumps(words)})")

    async def result(self, future: "Future[Result]") -> Result | None:
        """Wait for a result; return None after showing the reason of a refusal."""
        return future.result() if await self.succeeds(future) else None

    async def succeeds(self, future: "Future[Any]") -> bool:
        """Wait for success; return False after showing the reason of a refusal."""
        try:
            await asyncio.wrap_future(future)
        except RefusalError as error:
            self.say(str(error), "negative")
            return False
        return True

    @property
    def obstacle(self) -> str:
        """Why this page cannot command vehicles now; "" if it can."""
        if self.page == 0 or self.dashboard.pages.controller != self.page:
            return "take control first"
        return "" if self.past is None else "what is shown is past: press Now first"

    async def command(
        self, action: Action, names: Iterable[str], clicked: float, **details: Any
    ) -> bool:
        """Command vehicles; return whether all have accepted. A strip shows the outcome."""
        return await self.send(Command(action, tuple(names), clicked, **details))

    async def send(self, command: Command) -> bool:
        """Send a command as `command`."""
        try:
            outcomes = await asyncio.wrap_future(self.dashboard.command(self.page, command))
        except RefusalError:
            return False
        return not any(outcomes.values())

    async def take_control(self) -> None:
        """Take control; ask whether to take it over if another page has it."""
        pages = self.dashboard.pages
        try:
            pages.take(self.page)
        except RefusalError as error:
            with self._client, ui.dialog() as dialog, ui.card():
                ui.label(f"{str(error)[0].upper()}{str(error)[1:]}.")
                with ui.row():
                    take = ui.button("Take over", on_click=lambda: dialog.submit(True))
                    take.props(WARNING)
                    ui.button("Watch only", on_click=lambda: dialog.submit(False)).props("flat")
            if await dialog and self.page:
                pages.take(self.page, is_confirmed=True)
            dialog.delete()
