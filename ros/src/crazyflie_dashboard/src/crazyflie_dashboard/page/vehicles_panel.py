"""Cards of the vehicles, and commands for the chosen ones."""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.value_element import ValueElement
from nicegui.events import GenericEventArguments

from crazyflie_dashboard.actions import HEIGHTS
from crazyflie_dashboard.page.scene_view import SceneView, condition
from crazyflie_dashboard.page.session import CLICKED, WARNING, Session, allow
from crazyflie_dashboard.progress import REACHED
from crazyflie_dashboard.snapshot import Action, Scene, VehicleSnapshot
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_msgs.msg import FlightStatus
from crazyflie_takeoff.envelope import Box
from crazyflie_utils.flight_status import WORDS
from crazyflie_utils.refusal import listed

#: Names of the rates that are shown, by the topics' roles.
RATES = {
    "pose": "pose",
    "state": "state",
    "reference": "reference",
    "final_control": "control",
    "cmd_vel": "control",
}
CHARGE_RANGE = 3.0, 4.2  #: Voltages of an empty and of a full battery (V).
#: Axis and step (m) by which a key moves the goal.
NUDGES = {
    "ArrowLeft": (0, -0.1),
    "ArrowRight": (0, 0.1),
    "ArrowDown": (1, -0.1),
    "ArrowUp": (1, 0.1),
    "PageDown": (2, -0.1),
    "PageUp": (2, 0.1),
}
LOOKS = ("ground", "flight", "stale", "emergency")


class Cards(ValueElement, component="cards.js"):  # type: ignore[call-arg]
    """A card for each vehicle; the value is a tuple of what `card` returns."""

    VALUE_PROP = "vehicles"


class VehiclesPanel:
    """Buttons for the chosen vehicles, their goal, and the cards."""

    def __init__(self, session: Session, scene_view: SceneView):
        self._session = session
        self._scene_view = scene_view
        with ui.element("div").classes("tools"):
            self._choice = ui.label().classes("choice")
            ui.button("All", on_click=lambda: self._choose_only(session.vehicles)).props(
                "flat dense"
            )
            ui.button("None", on_click=lambda: self._choose_only(())).props("flat dense")
        self._buttons: dict[Action, ui.button] = {}
        with ui.element("div").classes("tools"):
            self._add_button("Take off", Action.TAKEOFF, "icon=flight_takeoff color=positive")
            self._height = _number("height, m", 1.0, *HEIGHTS)
            self._add_button("Land", Action.LAND, "icon=flight_land color=primary")
            self._add_button("Hold", Action.HOLD, "icon=pause color=secondary")
            self._add_button("Reset", Action.RESET, f"icon=restart_alt {WARNING}")
            self._buttons[Action.RESET].set_visibility(False)
        with ui.element("div").classes("tools goal"):
            self._goal = [_number(f"{axis}, m") for axis in "xyz"]
            self._yaw = _number("yaw, °")
            self._add_button("Go", Action.GO_TO, "icon=near_me color=accent")
        self._obstacles: dict[Action, str] = {}  # Why the selected vehicles cannot be commanded.
        for field in (*self._goal, self._yaw):
            field.on_value_change(self._draw_goal)
        for field in (self._height, *self._goal):
            field.on_value_change(self._allow)
        self._limits = ui.label().classes("hint limits")
        ui.label(
            "Click on the floor to set a goal, drag its handle, then press Go. Several vehicles "
            "keep their formation. Hold stops them where they are; a mission goes on with its next "
            "command."
        ).classes("hint")
        self._cards = Cards(value=())
        self._cards.on("choose", self._choose)
        self._cards.on("act", self._act)
        self._sent: tuple[float, ...] | None = None  # Goal of the last go-to command, m.
        scene_view.on("choose", self._choose)
        scene_view.on("goal", self._set_goal)

    def _add_button(self, text: str, action: Action, look: str) -> None:
        async def send(event: GenericEventArguments) -> None:
            await self._command(action, self._session.chosen_names, event.args)

        button = self._buttons[action] = ui.button(text).props(f"unelevated {look}")
        button.on("click", send, js_handler=CLICKED)

    def refresh(self, scene: Scene) -> None:
        """Show the present state of the vehicles, and what can be done with them."""
        names = self._session.chosen_names
        self._choice.text = f"{len(names)} of {len(scene.vehicles)} selected"
        chosen = [scene.vehicles[name] for name in names if name in scene.vehicles]
        obstacle = self._session.obstacle
        self._obstacles = {each: obstacle or why_not(each, chosen) for each in self._buttons}
        self._allow()
        self._buttons[Action.RESET].set_visibility(any(each.is_emergency for each in chosen))
        self._hide_goal_that_is_reached(chosen)
        self._limits.text = limits_text(self._session.dashboard.limits(names))
        left = {
            name: text
            for row in self._session.dashboard.progress()
            if row.is_open and self._session.past is None
            for name, text in row.left.items()
        }
        # A tuple: NiceGUI would watch each list in a list for changes.
        self._cards.value = tuple(
            card(each, each.name in names, obstacle, left.get(each.name, ""))
            for each in scene.vehicles.values()
        )

    def _allow(self) -> None:
        """Enable the buttons of what can be done now by what is in the fields."""
        for action, button in self._buttons.items():
            allow(button, self._obstacles.get(action, "") or self._missing(action))

    def _missing(self, action: Action) -> str:
        """Return what an action still needs, or ""."""
        if action is Action.TAKEOFF and self._height.value is None:
            return "type a height"
        if action is Action.GO_TO and None in self._typed:
            return "click on the floor, or type x, y and z"
        return ""

    @property
    def _typed(self) -> tuple[float | None, ...]:
        """The goal in the fields (m)."""
        return tuple(field.value for field in self._goal)

    def _choose(self, event: GenericEventArguments) -> None:
        self._session.choose([event.args["name"]], event.args["add"])
        self.refresh(self._session.scene())

    def _choose_only(self, names: Iterable[str]) -> None:
        self._session.choose(names)
        self.refresh(self._session.scene())

    async def _act(self, event: GenericEventArguments) -> None:
        action, names = Action(event.args["action"]), [event.args["name"]]
        await self._command(action, names, event.args["clicked"])

    async def _command(self, action: Action, names: Sequence[str], clicked: float) -> None:
        """Command vehicles by what is in the fields."""
        # The buttons of cards are not grey then.
        if missing := self._missing(action):
            self._session.say(f"{action.value}: {missing}", "warning")
            return
        details: dict[str, Any] = {}
        if action is Action.TAKEOFF:
            details = {"height": self._height.value}
        elif action is Action.GO_TO:
            yaw = None if self._yaw.value is None else math.radians(self._yaw.value)
            details = {"goal": self._typed, "yaw": yaw}
        else:
            self._sent = None if action is Action.HOLD else self._sent
            # A fleet refuses what one of the vehicles cannot do, as a landing on the ground.
            known = self._session.vehicles
            able = [n for n in names if n in known and action in offered(known[n], with_moves=True)]
            names = able or names
        if await self._session.command(action, names, clicked, **details) and "goal" in details:
            self._sent = details["goal"]

    def _set_goal(self, event: GenericEventArguments) -> None:
        x, y, z = self._goal
        x.value, y.value = round(event.args["x"], 2), round(event.args["y"], 2)
        if z.value is None:
            z.value = self._height.value or 1.0

    def nudge(self, key: str) -> None:
        """Move the goal, if there is one, by a key."""
        if key not in NUDGES or None in self._typed:
            return
        axis, step = NUDGES[key]
        self._goal[axis].value = round(self._goal[axis].value + step, 2)

    def clear_goal(self) -> None:
        """Remove the goal."""
        for field in self._goal:
            field.value = None

    def _draw_goal(self) -> None:
        x, y, z = self._typed
        is_set = None not in self._typed
        yaw = None if self._yaw.value is None else math.radians(self._yaw.value)
        self._scene_view.show_goal({"x": x, "y": y, "z": z, "yaw": yaw} if is_set else None)

    def _hide_goal_that_is_reached(self, chosen):
        """Remove the goal when the centre of the vehicles that were sent there has arrived."""
        places = [each.position for each in chosen if each.position is not None]
        if not self._sent or not places:
            return
        middle = [sum(place[k] for place in places) / len(places) for k in range(3)]
        if math.dist(middle, self._sent) < REACHED:
            # One that was set meanwhile stays.
            for field in self._goal[:2] if self._typed == self._sent else ():
                field.value = None
            self._sent = None


def limits_text(limits: tuple[Box, str] | None) -> str:
    """Return the limits of goals in words."""
    if limits is None:
        return ""
    box, what = limits
    sides = zip("xyz", box.lower, box.upper, strict=True)
    return f"{', '.join(f'{axis} {a:.4g} to {b:.4g}' for axis, a, b in sides)} m: {what}"


def attitude(vehicle: VehicleSnapshot) -> list[int]:
    """Return roll and pitch, in steps of 2 deg: a card that trembles would be sent all the time."""
    roll, pitch, _ = rpy_from_quaternion(*vehicle.rotation)
    return [2 * round(math.degrees(angle) / 2.0) for angle in (roll, pitch)]


def why_not(action: Action, vehicles: Sequence[VehicleSnapshot]) -> str:
    """Return why the selected vehicles cannot be commanded so, or "".

    Of a command that all carry out or none, each has to have the service, which may come later than
    the vehicle; otherwise one that can do it is enough.
    """
    if not vehicles:
        return "select vehicles first"
    lacking = [each.name for each in vehicles if action not in each.actions]
    if action in (Action.TAKEOFF, Action.GO_TO) and 0 < len(lacking) < len(vehicles):
        return f"{action.value}: no service of {listed(lacking)} is there for it"
    if any(action in offered(each, with_moves=True) for each in vehicles):
        return ""
    states = sorted({each.state for each in vehicles})
    return f"{action.value}: the selected vehicles are {', '.join(states)}"


def card(
    vehicle: VehicleSnapshot, is_chosen: bool, obstacle: str = "", left: str = ""
) -> dict[str, Any]:
    """Return the data that cards.js shows of a vehicle; a fact is name, value, style.

    ``obstacle`` is why it cannot be commanded, and ``left`` what is left of the command that it
    carries out.
    """
    battery = "" if vehicle.battery is None else f"{vehicle.battery:.2f} V"
    link = "" if vehicle.link_quality is None else f"{vehicle.link_quality:.0%}"
    is_weak = vehicle.link_quality is not None and vehicle.link_quality < 0.5
    facts = [
        ["battery", battery, "warn" if vehicle.is_battery_low else ""],
        ["link", link, "warn" if is_weak else ""],
        ["pose", _age(vehicle.pose_age), "warn" if vehicle.is_stale else ""],
        ["control", _age(vehicle.control_age), ""],
    ]
    known = {RATES[role]: rate for role, rate in vehicle.rates.items() if role in RATES and rate}
    if rates := ", ".join(f"{what} {rate:.0f}" for what, rate in known.items()):
        facts.append(["rates", f"{rates} Hz", "wide"])
    if vehicle.position is not None:
        place = "  ".join(f"{each:z.2f}" for each in vehicle.position)
        facts.insert(0, ["position", f"{place} m", "wide"])
    if left:
        facts.insert(0, ["command", left, "wide"])
    return {
        "name": vehicle.name,
        "kind": vehicle.kind.value,
        "state": "no pose" if vehicle.pose_age is None and vehicle.is_stale else vehicle.state,
        "reason": _reason(vehicle),
        "look": LOOKS[condition(vehicle)],
        "attitude": None if vehicle.position is None else attitude(vehicle),
        "facts": [fact for fact in facts if fact[1]],
        "actions": _texts(frozenset(offered(vehicle))),
        "charge": None if vehicle.battery is None else _charge(vehicle.battery),
        "chosen": is_chosen,
        "locked": obstacle,
    }


def offered(vehicle: VehicleSnapshot, with_moves: bool = False) -> set[Action]:
    """Return the commands that it accepts in its present state; its card has no goals."""
    shown = set(vehicle.actions) - (set() if with_moves else {Action.GO_TO})
    if vehicle.is_emergency:
        return shown - {Action.TAKEOFF, Action.LAND, Action.ARM, Action.HOLD, Action.GO_TO}
    shown.discard(Action.RESET)
    if vehicle.is_in_flight:
        return shown - {Action.TAKEOFF, Action.ARM, Action.DISARM, Action.REBOOT}
    # Whether one flies whose state is not known is not known, either.
    is_down = vehicle.state == WORDS[FlightStatus.ON_GROUND]
    return shown - {Action.HOLD, Action.GO_TO, *([Action.LAND] if is_down else [])}


@lru_cache
def _texts(actions: frozenset[Action]) -> list[str]:
    """Return the texts of buttons, in the order of the enum; the emergency stands apart."""
    shown = [each.value for each in Action if each in actions - {Action.EMERGENCY}]
    return shown + [each.value for each in actions & {Action.EMERGENCY}]


def _charge(voltage: float) -> float:
    # Rounded: a bar that changes with every millivolt would be sent all the time.
    low, high = CHARGE_RANGE
    return round(min(max((voltage - low) / (high - low), 0.0), 1.0), 2)


def _reason(vehicle):
    if vehicle.is_emergency:
        return f"{vehicle.reason or 'motors are off'} · to fly again, press reset first"
    if vehicle.is_held:
        return "held by the fleet: too near to another vehicle"
    return vehicle.reason or ("" if vehicle.is_in_flight else vehicle.takeoff_refusal)


def _age(age: float | None) -> str:
    # Rounded: a card that changes with every hundredth of a second would be sent all the time.
    if age is None:
        return ""
    return "now" if age < 0.3 else f"{age:.1f} s ago" if age < 10 else f"{age:.0f} s ago"


def _number(
    label: str, value: float | None = None, low: float | None = None, high: float | None = None
) -> ui.number:
    field = ui.number(label, value=value, step=0.1, min=low, max=high)
    return field.props("dense outlined hide-bottom-space").classes("number")
