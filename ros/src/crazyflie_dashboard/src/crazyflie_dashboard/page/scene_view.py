"""The three-dimensional scene: what the browser's part, scene_view.js, is told."""

import math
import time
from collections import deque
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import roslib.packages
from nicegui import core, ui
from nicegui.element import Element

from crazyflie_dashboard.snapshot import Rotation, Scene, Triple, VehicleSnapshot

FOLDER = Path(__file__).parent
MAX_UNANSWERED = 3  #: Scenes that a browser has not taken, before no more is sent,
ANSWER_LIMIT = 2.0  #: for so long, s.
DIGITS = 4  #: Of positions in m and of quaternions, for the browser.

ui.scene  # noqa: B018  Registers three.js.


@lru_cache(1)
def vehicle_model() -> list[list[Any]]:
    """Return the parts of the vehicle in crazyflie_description.

    Returns
    -------
    list
        Of each part the number of its propeller (0 for the body), its shape and size (m), position
        (m) and roll, pitch, yaw (rad), and color. A propeller begins with its hub.
    """
    folder = Path(roslib.packages.get_pkg_dir("crazyflie_description"))
    robot: Any = ElementTree.parse(folder / "urdf" / "crazyflie2.urdf").getroot()
    colors = {
        material.get("name"): _numbers(material.find("color"), "rgba")
        for material in robot.findall("material")
    }
    parts = []
    for visual in robot.iter("visual"):
        name = visual.get("name", "")
        kind, _, motor = name.partition("_")
        # A disc would hide the blades that turn.
        if kind == "disc":
            continue
        shape = visual.find("geometry")[0]
        size = {
            "box": lambda shape=shape: _numbers(shape, "size"),
            "cylinder": lambda shape=shape: _numbers(shape, "radius") + _numbers(shape, "length"),
            "sphere": lambda shape=shape: _numbers(shape, "radius"),
        }[shape.tag]()
        origin = visual.find("origin")
        propeller = int(motor[0]) if kind in ("hub", "blade") else 0
        color = colors[visual.find("material").get("name")]
        place = [_numbers(origin, "xyz"), _numbers(origin, "rpy")]
        parts.append([propeller, shape.tag, size, *place, color])
    return parts


def _numbers(element, attribute):
    return [float(text) for text in element.get(attribute, "0 0 0").split()]


class SceneView(
    Element,
    component="scene_view.js",  # type: ignore[call-arg]
    esm={"dashboard-objects": str(FOLDER / "objects")},
):
    """The scene in one page."""

    def __init__(self) -> None:
        super().__init__()
        self._props["model"] = vehicle_model()
        self._shown: dict[str, Any] = {}
        self._world: tuple[Any, Any] = (None, None)
        self._unanswered: deque[float] = deque()
        self.on("ready", self._begin)

    def _begin(self) -> None:
        self._shown.clear()
        self._unanswered.clear()
        self._world = (None, None)

    async def show(self, scene: Scene, chosen: set[str], extra_paths: Mapping[str, Any]) -> None:
        """Draw a scene; what has not changed since the last one is not sent."""
        self._send("setNames", [list(scene.vehicles)])
        # They may be many, and are the same objects until they change.
        if scene.solids is not self._world[0] or scene.fences != self._world[1]:
            self._world = scene.solids, scene.fences
            self._send("setWorld", [[_solid(each) for each in scene.solids], scene.fences])
        self._send("setPaths", [[*scene.paths.values(), *extra_paths.values()]])
        frames = [[each.name, *_pose(each.position, each.rotation)] for each in scene.frames]
        self._send("setFrames", [frames])
        rows = vehicle_rows(scene, chosen)
        if self._shown.get("update") != rows and self._may_send():
            self._shown["update"] = rows
            self._unanswered.append(time.monotonic())
            # As an event: the browser would compile, and keep for long, each call of a method.
            await core.sio.emit("vehicles", rows, room=self.client.id, callback=self._on_answer)

    def _may_send(self) -> bool:
        """Return whether the browser keeps up; what it has not taken yet, it would see too late."""
        while self._unanswered and time.monotonic() - self._unanswered[0] > ANSWER_LIMIT:
            self._unanswered.popleft()
        return len(self._unanswered) < MAX_UNANSWERED

    def _on_answer(self, *_: Any) -> None:
        if self._unanswered:
            self._unanswered.popleft()

    def show_goal(self, goal: dict[str, float | None] | None) -> None:
        """Draw where a go to leads: x, y, z (m) and yaw (rad, or None)."""
        self._send("setGoal", [goal])

    def look(self, view: str, name: str | None = None) -> None:
        """Look from "above", at "all", or "follow" a vehicle."""
        self.run_method("look", view, name)

    def _send(self, method, arguments):
        if self._shown.get(method) != arguments:
            self._shown[method] = arguments
            self.run_method(method, *arguments)


def vehicle_rows(scene: Scene, chosen: set[str]) -> list[list[Any]]:
    """Return the vehicles as scene_view.js draws them."""
    rows = []
    for name, vehicle in scene.vehicles.items():
        pose = _pose(vehicle.position, vehicle.rotation)
        age = f"{vehicle.pose_age:.0f} s old" if vehicle.is_stale and vehicle.pose_age else ""
        remark = "emergency" if vehicle.is_emergency else age or ("held" if vehicle.is_held else "")
        reference = vehicle.reference.position if vehicle.reference else ()
        row = [*pose, condition(vehicle), name in chosen, remark, *_rounded(reference)]
        rows.append(row)
    return rows


def condition(vehicle: VehicleSnapshot) -> int:
    """Return how a vehicle is drawn: 0 on the ground, 1 in flight, 2 stale, 3 emergency."""
    if vehicle.is_emergency:
        return 3
    return 2 if vehicle.is_stale else int(vehicle.is_in_flight)


def _solid(solid):
    *rgb, opacity = solid.colour
    color = "#" + "".join(f"{round(255 * min(1, max(0, part))):02x}" for part in rgb)
    return [solid.shape, solid.position, solid.rotation, solid.size, color, opacity]


def _pose(position: Triple | None, rotation: Rotation) -> list[Any]:
    if position is None or not all(map(math.isfinite, (*position, *rotation))):
        return [None, None, None, 0, 0, 0, 1]
    return _rounded((*position, *rotation))


def _rounded(numbers: Iterable[float]) -> list[float]:
    return [round(number, DIGITS) for number in numbers]
