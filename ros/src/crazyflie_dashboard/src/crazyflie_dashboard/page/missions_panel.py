"""Missions and trajectories: a dry run first, then the flight."""

import asyncio
import contextlib
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from crazyflie_dashboard.page.scene_view import SceneView
from crazyflie_dashboard.page.session import CLICKED, Session, allow
from crazyflie_dashboard.page.waypoints_bar import WaypointsBar
from crazyflie_dashboard.snapshot import Scene
from crazyflie_utils.refusal import RefusalError, listed


class MissionsPanel:
    """A list of what can be flown; it flies after its dry run has passed."""

    def __init__(self, session: Session, scene_view: SceneView):
        self._session = session
        #: The mission and the vehicles whose dry run has passed.
        self._passed: tuple[str, tuple[str, ...]] | None = None
        self._choice = ui.label().classes("choice")
        self._file = ui.select({}, label="mission or trajectory")
        self._file.on("update:model-value", self._forget)
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
        WaypointsBar(session, scene_view, self._choose)
        self._result = ui.label().classes("result")
        self.list_files()
        session.on_restore.append(self._restore)

    def _restore(self, kept: dict[str, Any]) -> None:
        mission, names = kept.get("mission", ""), tuple(kept.get("passed", ()))
        if mission in self._file.options:
            self._file.value = mission
            self._passed = (mission, names) if names else None

    def _choose(self, path: Path) -> None:
        """Choose a mission that was saved; a file of this name may have been another one."""
        self.list_files()
        self._forget()
        self._file.value = str(path)

    def list_files(self) -> None:
        """Show the missions and trajectories that there are now."""
        files = self._session.dashboard.mission_files()
        self._file.set_options({str(path): path.name for path in files})

    def refresh(self, scene: Scene) -> None:
        """Show the vehicles of the mission, and whether it may fly."""
        names = self._session.chosen_names
        self._choice.text = f"For {listed(names)}" if names else "No vehicle is selected"
        why = _why_not(self._session, names)
        allow(self._dry_run, why or ("" if self._file.value else "choose a mission first"))
        passed = self._passed == (self._file.value, names)
        why = why or ("a mission is flying" if scene.missions else "")
        allow(self._fly, why or ("" if passed else "a dry run has to pass first"))

    def _forget(self) -> None:
        self._passed = None
        self._session.keep(mission=self._file.value, passed=())
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
        self._session.keep(passed=names if result.passed else ())

    async def _start(self, event: GenericEventArguments) -> None:
        if self._passed is None:
            return
        mission, names = Path(self._passed[0]), self._passed[1]
        future = self._session.dashboard.fly(self._session.page, mission, names, event.args)
        # What becomes of it is on its strip.
        with contextlib.suppress(RefusalError):
            await asyncio.wrap_future(future)


def _why_not(session, names):
    return session.obstacle or ("" if names else "select vehicles first")
