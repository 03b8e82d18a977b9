"""Waypoints: set in the scene, and saved as a mission."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from crazyflie_dashboard.page.scene_view import SceneView
from crazyflie_dashboard.page.session import Session, allow
from crazyflie_dashboard.waypoints import Waypoints

HEIGHT = 1.0  #: Height of a waypoint that is set (m).


class WaypointsBar:
    """A switch for clicks in the scene, and what can be done with the waypoints.

    ``on_saved(path)`` is called with the file of a mission that was saved.
    """

    def __init__(self, session: Session, scene: SceneView, on_saved: Callable[[Path], Any]):
        self._session, self._scene, self._on_saved = session, scene, on_saved
        self._waypoints = Waypoints()
        self._waypoints.on_change = self._draw
        with ui.element("div").classes("tools apart"):
            self._on = ui.switch("Waypoints", on_change=self._switch).props("dense")
            self._height = ui.number("height, m", value=HEIGHT, step=0.1, min=0.1, max=5.0)
            self._height.props("dense outlined hide-bottom-space").classes("level")
            self._undo = ui.button("Undo", on_click=self._waypoints.undo).props("flat dense")
            self._clear = ui.button("Clear", on_click=self._waypoints.clear).props("flat dense")
        with ui.element("div").classes("tools"):
            self._name = ui.input("name of the mission", value="waypoints")
            self._name.props("dense outlined").classes("number")
            self._save = ui.button("Save", on_click=self._keep).props("outline")
        self._text = ui.label(
            "While Waypoints is on: click on the floor to add one, on the line to insert one, drag "
            "one to move it. Save makes a mission of them, which ./run mission flies, too."
        ).classes("hint")
        scene.on("waypoint", self._change)
        self._draw()

    def _switch(self) -> None:
        self._scene.run_method("setWaypointing", self._on.value)

    def _change(self, event: GenericEventArguments) -> None:
        number, x, y, z = (event.args[key] for key in ("number", "x", "y", "z"))
        if event.args["moves"]:
            _, _, z = self._waypoints.points[number]
            self._waypoints.move(number, (x, y, z))
        else:
            height = self._height.value or HEIGHT
            self._waypoints.insert(number, (x, y, height if z is None else z))

    def _draw(self) -> None:
        points = self._waypoints.points
        self._scene.show_waypoints(points)
        why = "" if points else "no waypoint is set"
        for button in (self._clear, self._save):
            allow(button, why)
        allow(self._undo, "" if self._waypoints.can_undo else "no waypoint was changed")

    async def _keep(self) -> None:
        future = self._session.dashboard.save_waypoints(
            (self._name.value or "").strip(), self._waypoints.points
        )
        path = await self._session.result(future)
        if path is not None:
            self._on.value = False
            self._on_saved(path)
