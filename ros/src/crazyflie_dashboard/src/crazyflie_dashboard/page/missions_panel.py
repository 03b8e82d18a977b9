"""Missions and trajectories: a dry run first, then the flight."""

from pathlib import Path

from nicegui import ui
from nicegui.events import GenericEventArguments

from crazyflie_dashboard.page.session import CLICKED, Session
from crazyflie_dashboard.snapshot import Scene


class MissionsPanel:
    """A list of what can be flown; it flies after its dry run has passed."""

    def __init__(self, session: Session):
        self._session = session
        #: The mission and the vehicles whose dry run has passed.
        self._passed: tuple[str, tuple[str, ...]] | None = None
        self._choice = ui.label().classes("choice")
        self._file = ui.select({}, label="mission or trajectory", on_change=self._forget)
        self._file.props("dense outlined options-dense").classes("apart")
        with ui.element("div").classes("tools apart"):
            self._dry_run = ui.button("Dry run", on_click=self._start_dry_run)
            self._dry_run.props("outline icon=play_circle")
            self._fly = ui.button("Fly").props("unelevated color=positive icon=flight")
            self._fly.on("click", self._start, js_handler=CLICKED)
        ui.label(
            "A dry run flies the mission with ideal vehicles from where the chosen ones are, and "
            "checks speeds, distances and fences; nothing moves. When it has passed, Fly flies it. "
            "For missions of your own: dashboard.launch folders:=DIRECTORY."
        ).classes("hint apart")
        self._result = ui.label().classes("result")
        self._running = ui.label().classes("hint")
        self.list_files()

    def list_files(self) -> None:
        """Show the missions and trajectories that there are now."""
        files = self._session.dashboard.mission_files()
        self._file.set_options({str(path): path.name for path in files})

    def refresh(self, scene: Scene) -> None:
        """Show the vehicles of the mission, and whether it may fly."""
        names = self._session.chosen_names
        self._choice.text = f"For {', '.join(names)}" if names else "For vehicles that are chosen"
        self._fly.set_enabled(self._passed == (self._file.value, names) and bool(names))
        self._running.text = " · ".join(scene.missions)

    def _forget(self) -> None:
        self._passed = None
        self._session.dashboard.forget_paths(self._session.page)
        self._tell("", "")

    def _tell(self, text: str, look: str) -> None:
        self._result.text = text
        self._result.classes(remove="good bad", add=look)

    async def _start_dry_run(self) -> None:
        names = self._session.chosen_names
        chosen = self._file.value
        if not chosen or not names:
            self._session.say("dry run: choose a mission and its vehicles first", "warning")
            return
        self._forget()
        self._dry_run.props(add="loading")
        future = self._session.dashboard.dry_run(self._session.page, Path(chosen), names)
        result = await self._session.result(future)
        self._dry_run.props(remove="loading")
        if result is None:
            return
        if self._file.value != chosen:
            self._forget()
            return
        self._tell(
            f"The dry run has passed: {result.text}" if result.passed else result.text,
            "good" if result.passed else "bad",
        )
        self._passed = (chosen, names) if result.passed else None

    async def _start(self, event: GenericEventArguments) -> None:
        if self._passed is None:
            return
        mission, names = Path(self._passed[0]), self._passed[1]
        future = self._session.dashboard.fly(self._session.page, mission, names, event.args)
        text = await self._session.result(future)
        if text is not None:
            self._session.say(f"{mission.name}: {text}", "positive")
