"""The three-dimensional scene: the server's part, which sends data to scene_view.js."""

import time
from base64 import b64encode
from collections import deque
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import roslib.packages
from nicegui import core, json, ui
from nicegui.element import Element

from crazyflie_dashboard.snapshot import Scene, Solids, Triple, VehicleSnapshot

FOLDER = Path(__file__).parent
#: Number of unanswered scenes after which a browser is sent no more, for `ANSWER_LIMIT` at most.
MAX_UNANSWERED = 3
ANSWER_LIMIT = 2.0  #: Time after which a scene is treated as answered (s).
PART_TIME = 1e-5  #: Time between two transmissions of solids, for each of them (s).
#: Colors of vehicles, for plans and plots; they can be read on a light page and on a dark one.
COLORS = ("#2f86dd", "#d07c00", "#9a68e8", "#0e9aa7", "#db4f98", "#6d9a1f", "#7b8798", "#a9794a")
DIGITS = 4  #: Decimal places of positions (m) and quaternions that the browser is sent.
_NOWHERE = (np.nan, np.nan, np.nan, 0.0, 0.0, 0.0, 1.0)  # Not a number is null in JSON.

ui.scene  # noqa: B018  Registers three.js.


@lru_cache(1)
def vehicle_model() -> list[list[Any]]:
    """Return the parts of the vehicle in crazyflie_description.

    Returns
    -------
    list
        For each part the number of its propeller (0 for the body), its shape and size (m), position
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
        self._solids: list[Solids] = []
        self._solids_at = 0.0  # Time from which solids may be sent again (s).
        self._unanswered: deque[float] = deque()
        self.on("ready", self._begin)

    def _begin(self) -> None:
        self._shown.clear()
        self._unanswered.clear()
        self._solids, self._solids_at = [], 0.0

    async def show(self, scene: Scene, chosen: set[str]) -> None:
        """Draw a scene; parts that have not changed since the last one are not sent."""
        self._send("setNames", [list(scene.vehicles)])
        solids = [each.what for each in scene.solids]
        if solids != self._solids and time.monotonic() >= self._solids_at:
            self._solids = solids
            count = sum(len(each.rows) for each in solids)
            self._solids_at = time.monotonic() + PART_TIME * count
            self.run_method("setSolids", [_packed(each) for each in solids])
        if solids == self._solids:
            self._send("placeSolids", [[place for _, *place in scene.solids]])
        fences = [[box.lower, box.upper, *place] for box, *place in scene.fences]
        self._send("setFences", [fences])
        self._send("setPaths", [path_rows(scene)])
        frames = [[name, *_rounded((*place, *turn))] for name, place, turn in scene.frames]
        self._send("setFrames", [frames])
        rows = vehicle_rows(scene, chosen)
        if self._shown.get("update") != rows and self._may_send():
            self._shown["update"] = rows
            self._unanswered.append(time.monotonic())
            # Sent as an event: the browser would compile, and keep for long, each call of a method.
            # As one text: socket.io looks for bytes in each part of a list.
            await core.sio.emit("vehicles", rows, room=self.client.id, callback=self._on_answer)

    def _may_send(self) -> bool:
        """Return whether the browser keeps up; otherwise it would show scenes too late."""
        while self._unanswered and time.monotonic() - self._unanswered[0] > ANSWER_LIMIT:
            self._unanswered.popleft()
        return len(self._unanswered) < MAX_UNANSWERED

    def _on_answer(self, *_: Any) -> None:
        if self._unanswered:
            self._unanswered.popleft()

    def show_goal(self, goal: dict[str, float | None] | None) -> None:
        """Draw the goal of a go-to command: x, y, z (m) and yaw (rad, or None)."""
        self._send("setGoal", [goal])

    def show_waypoints(self, points: Iterable[Triple]) -> None:
        """Draw waypoints (m) and the line through them."""
        self._send("setWaypoints", [[*points]])

    def look(self, view: str, name: str | None = None) -> None:
        """Set the view: from "above", on "all", or "follow" a vehicle."""
        self.run_method("look", view, name)

    def _send(self, method, arguments):
        if self._shown.get(method) != arguments:
            self._shown[method] = arguments
            self.run_method(method, *arguments)


def vehicle_rows(scene: Scene, chosen: set[str]) -> str:
    """Return the vehicles as scene_view.js draws them, as JSON."""
    vehicles = scene.vehicles.values()
    poses = np.array([(*(each.position or _NOWHERE[:3]), *each.rotation) for each in vehicles])
    poses = poses.reshape(-1, 7).round(DIGITS)
    poses[~np.isfinite(poses).all(axis=1)] = _NOWHERE
    rows: list[list[Any]] = poses.tolist()
    for row, vehicle in zip(rows, vehicles, strict=True):
        age = f"{vehicle.pose_age:.0f} s old" if vehicle.is_stale and vehicle.pose_age else ""
        remark = "emergency" if vehicle.is_emergency else age or ("held" if vehicle.is_held else "")
        row += [condition(vehicle), vehicle.name in chosen, remark]
        row += _rounded(vehicle.reference or ())
    return json.dumps(rows)


def path_rows(scene: Scene) -> list[list[Any]]:
    """Return the planned paths, each with the color of its vehicle."""
    numbers = {name: k for k, name in enumerate(scene.vehicles)}
    owners = (next((part for part in key.split("/") if part in numbers), "") for key in scene.paths)
    colors = (COLORS[numbers.get(name, 2) % len(COLORS)] for name in owners)
    return [[path, color] for path, color in zip(scene.paths.values(), colors, strict=True)]


def condition(vehicle: VehicleSnapshot) -> int:
    """Return the style of a vehicle: 0 on the ground, 1 in flight, 2 stale, 3 emergency."""
    if vehicle.is_emergency:
        return 3
    return 2 if vehicle.is_stale else int(vehicle.is_in_flight)


def _packed(solids):
    """Return solids in the browser's format: arrays as base64, since they may be long."""
    rows, colours = (b64encode(each).decode() for each in (solids.rows, solids.colours))
    return [solids.shape, rows, colours, solids.opacity, solids.width]


def _rounded(numbers: Iterable[float]) -> list[float]:
    return [round(number, DIGITS) for number in numbers]
