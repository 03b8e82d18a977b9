"""The parts of a page, and its timers, which follow the graph."""

import json
import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from nicegui import context, ui
from nicegui.events import GenericEventArguments, KeyEventArguments

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.page.cameras_panel import CamerasPanel
from crazyflie_dashboard.page.messages_panel import MessagesPanel
from crazyflie_dashboard.page.missions_panel import MissionsPanel
from crazyflie_dashboard.page.parameters_panel import ParametersPanel
from crazyflie_dashboard.page.plots_panel import PlotsPanel
from crazyflie_dashboard.page.recordings_panel import RecordingsPanel
from crazyflie_dashboard.page.scene_view import SceneView
from crazyflie_dashboard.page.session import CLICKED, WARNING, Session, allow
from crazyflie_dashboard.page.strips import Strips
from crazyflie_dashboard.page.timebar import TimeBar
from crazyflie_dashboard.page.vehicles_panel import VehiclesPanel
from crazyflie_dashboard.snapshot import Scene, Sentence, VehicleSnapshot

SCENE_PERIOD = 0.05
#: Keys and what they do, as the page says.
KEYS = (
    ("Esc Esc", "emergency: stop the motors of all vehicles"),
    ("← → ↑ ↓", "move the goal by 0.1 m along x and y"),
    ("Page ↑, Page ↓", "raise or lower it by 0.1 m"),
    ("click on the floor", "set the goal, or a waypoint"),
    ("Ctrl + click", "add a vehicle to the selection, or remove it"),
    ("Shift + click, twice", "distance of two points"),
    ("drag, wheel", "turn the view, zoom"),
    ("?", "this list"),
)
PANEL_PERIOD = 0.5  #: Period of the panels (s).
MAX_SCENE_AGE = 1.0  #: Age after which a scene is shown as old (s).
ALARM = (
    "Sounds when a vehicle has an emergency, or in flight no pose, a low battery or one too near"
)
LOADING_TIME = 2.0  #: Longest time until the first scene (s).


class View:
    """A page: bar, scene, and panels. It is built when a browser asks for the page."""

    def __init__(self, dashboard: Dashboard):
        self._dashboard = dashboard
        self._session = Session(dashboard, context.client)
        self._alarms: set[str] = set()
        self._loaded = time.monotonic()
        with ui.element("div").classes("page"):
            with ui.element("div").classes("bar"):
                self._build_bar()
            with ui.element("div").classes("main"):
                with ui.element("div").classes("stage"):
                    with ui.element("div").classes("view"):
                        self._scene_view = SceneView()
                        self._build_views()
                        self._strips = Strips(self._session)
                    self._timebar = TimeBar(self._session)
                with ui.element("div").classes("side"):
                    self._build_panels()
        self._session.on_seek = self._seek
        ui.keyboard(self._on_key)
        ui.timer(SCENE_PERIOD, self._draw)
        ui.timer(PANEL_PERIOD, self._refresh)

    def _build_bar(self) -> None:
        ui.label("Mission control").classes("title")
        self._summary = ui.label().classes("summary")
        ui.element("div").classes("space")
        self._stop = ui.button("Stop mission").props(f"unelevated {WARNING} icon=stop")
        self._stop.classes("sign").on("click", self._stop_mission, js_handler=CLICKED)
        self._record = ui.button("Record", on_click=self._turn_recording)
        self._record.props("flat dense icon=fiber_manual_record").classes("sign")
        self._sound = ui.switch("Alarm", value=True).props(f'dense title="{ALARM}"')
        self._control = ui.label().classes("control")
        self._take = ui.button("Take control", on_click=self._take_or_release)
        self._take.props("outline").classes("take")
        emergency = ui.button("Emergency").props("unelevated color=negative icon=dangerous")
        # No tooltip: it would stay and cover the tabs.
        emergency.props('aria-label="Emergency: stop the motors of all vehicles"')
        emergency.classes("emergency-all").on("click", js_handler="(event) => emergency(event)")
        with emergency:
            ui.label("Esc Esc").classes("key")

    def _build_views(self) -> None:
        with ui.element("div").classes("views"):
            for text, view, icon in (
                ("Overview", "all", "zoom_out_map"),
                ("Above", "above", "vertical_align_bottom"),
                ("Follow", "follow", "center_focus_strong"),
            ):
                button = ui.button(
                    text,
                    color=None,
                    on_click=lambda view=view: self._scene_view.look(view, self._watched()),
                )
                button.props(f'dense unelevated icon={icon} aria-label="{text}"')
            clear = ui.button("Clear", color=None, on_click=self._clear)
            clear.props('dense unelevated icon=clear aria-label="Clear"')
            clear.props('title="Remove plans, goal and distance from the scene"')

    def _build_panels(self) -> None:
        builders: dict[str, Callable[[Session], Any]] = {
            "Vehicles": partial(VehiclesPanel, scene_view=self._scene_view),
            "Plots": PlotsPanel,
            "Parameters": ParametersPanel,
            "Missions": partial(MissionsPanel, scene_view=self._scene_view),
            "Recordings": RecordingsPanel,
            "Messages": MessagesPanel,
            "Cameras": CamerasPanel,
        }
        with ui.tabs().props("dense no-caps inline-label outside-arrows") as tabs:
            for name in builders:
                ui.tab(name)
        self._tabs = ui.tab_panels(tabs, value="Vehicles", animated=False, keep_alive=True)
        self._panels = {}
        with self._tabs.classes("panels"):
            for name, build in builders.items():
                with ui.tab_panel(name):
                    self._panels[name] = build(self._session)
        tabs.on_value_change(self._list)
        tabs.on_value_change(self._refresh)
        tabs.on_value_change(lambda event: self._session.keep(tab=event.value))
        self._session.on_restore.append(lambda kept: tabs.set_value(kept.get("tab", tabs.value)))

    def _list(self) -> None:
        """Let a panel that is shown look for new files."""
        getattr(self._panels[self._tabs.value], "list_files", lambda: None)()

    def _clear(self) -> None:
        self._dashboard.forget_paths(self._session.page)
        self._panels["Vehicles"].clear_goal()
        self._scene_view.run_method("clear")

    def _on_key(self, event: KeyEventArguments) -> None:
        if not event.action.keydown:
            return
        if event.key == "?":
            self._show_keys()
        elif not (event.modifiers.ctrl or event.modifiers.alt or event.modifiers.meta):
            self._panels["Vehicles"].nudge(event.key.name)

    def _show_keys(self) -> None:
        with ui.dialog() as dialog, ui.card(), ui.element("dl").classes("keys"):
            for key, what in KEYS:
                with ui.element("div"):
                    with ui.element("dt"):
                        ui.label(key)
                    with ui.element("dd"):
                        ui.label(what)
        dialog.on_value_change(lambda event: None if event.value else dialog.delete())
        dialog.open()

    def _watched(self) -> str | None:
        return self._session.watched or next(iter(self._session.vehicles), None)

    def _scene(self) -> Scene:
        """Return the newest scene; if it is late, with all vehicles stale."""
        scene = self._dashboard.scene()
        is_first = scene.made == math.inf
        age = time.monotonic() - (self._loaded + LOADING_TIME if is_first else scene.made)
        if age <= MAX_SCENE_AGE:
            return scene
        text = f"what is shown is {age:.0f} s old: the dashboard is held up"
        vehicles = {
            name: each._replace(is_stale=True, pose_age=each.pose_age and each.pose_age + age)
            for name, each in scene.vehicles.items()
        }
        held_up = Sentence("error", "dashboard", text, "look at its log")
        return replace(scene, vehicles=vehicles, sentences=(held_up, *scene.sentences))

    async def _draw(self) -> None:
        scene = self._scene() if self._session.past is None else self._session.scene()
        await self._scene_view.show(scene, self._session.chosen)

    def _seek(self) -> None:
        self._scene_view.run_method("setPast", self._session.past is not None)
        self._refresh()

    def _refresh(self) -> None:
        ui.run_javascript(f"setBeat({time.monotonic()})")
        scene = self._scene()
        flying = sum(each.is_in_flight for each in scene.vehicles.values())
        count = len(scene.vehicles)
        noun = "vehicle" if count == 1 else "vehicles"
        trouble = next((f" · {s.text}" for s in scene.sentences if s.source == "dashboard"), "")
        self._summary.text = (
            f"{count} {noun} · {flying} in flight · frame {scene.fixed_frame}{trouble}"
        )
        self._summary.classes(add="bad" if trouble else "", remove="" if trouble else "bad")
        alarms = {what for each in scene.vehicles.values() for what in alarms_of(each)}
        if self._sound.value and (new := sorted(alarms - self._alarms)):
            ui.run_javascript(f"alarm({json.dumps(new)})")
        self._alarms = alarms
        why = self._session.obstacle
        self._stop.set_visibility(bool(scene.missions))
        allow(self._stop, why)
        is_on = scene.recording == "recording"
        self._record.text = "Stop recording" if is_on else "Record"
        self._record.classes(add="recording" if is_on else "", remove="" if is_on else "recording")
        is_busy = scene.recording not in ("", "recording")
        allow(self._record, why or (scene.recording if is_busy else ""))
        self._show_control()
        self._session.watch_plotted()
        self._strips.refresh(time.monotonic(), self._session.obstacle)
        self._timebar.refresh(time.monotonic(), scene)
        is_now = self._session.past is None
        self._panels[self._tabs.value].refresh(scene if is_now else self._session.scene())

    def _show_control(self) -> None:
        page, controller = self._session.page, self._dashboard.pages.controller
        has = page != 0 and controller == page
        other = "no page" if controller is None else f"page {controller}"
        self._control.text = (
            f"page {page} · you have control" if has else f"page {page} · {other} has control"
        )
        look = "mine" if has else "none" if controller is None else "other"
        # In one call: two calls would change the label, and send it, even if nothing is new.
        self._control.classes(look, remove="mine other none")
        self._take.text = "Release control" if has else "Take control"

    async def _take_or_release(self) -> None:
        if self._dashboard.pages.controller == self._session.page:
            self._dashboard.pages.release(self._session.page)
        else:
            await self._session.take_control()
        self._refresh()

    async def _turn_recording(self) -> None:
        is_on = not self._dashboard.scene().recording
        report = await self._session.result(self._dashboard.record(self._session.page, is_on))
        if report is not None:
            self._session.show_report()

    async def _stop_mission(self, event: GenericEventArguments) -> None:
        await self._session.succeeds(self._dashboard.stop_mission(self._session.page, event.args))


def alarms_of(vehicle: VehicleSnapshot) -> list[str]:
    """Return the alarms of a vehicle, as words."""
    found = ["emergency"] if vehicle.is_emergency else []
    if vehicle.is_in_flight:
        found += ["no pose"] if vehicle.is_stale else []
        found += ["battery low"] if vehicle.is_battery_low else []
        found += ["held"] if vehicle.is_held else []
    return [f"{vehicle.name}: {what}" for what in found]
