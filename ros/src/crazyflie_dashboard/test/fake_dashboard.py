"""A dashboard of vehicles that are only numbers, for tests of the page."""

import math
import time
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from crazyflie_dashboard.control import PageControl
from crazyflie_dashboard.history import History
from crazyflie_dashboard.moves import formation
from crazyflie_dashboard.page_data import (
    DryRunResult,
    ParameterInfo,
    Series,
)
from crazyflie_dashboard.progress import Commands
from crazyflie_dashboard.recording import Recorded
from crazyflie_dashboard.snapshot import (
    Action,
    LogLine,
    Placed,
    Scene,
    Sentence,
    VehicleSnapshot,
)
from crazyflie_dashboard.surroundings import grouped
from crazyflie_takeoff.envelope import Box
from crazyflie_utils.refusal import RefusalError

ACTIONS = frozenset(
    {Action.TAKEOFF, Action.LAND, Action.GO_TO, Action.HOLD, Action.EMERGENCY, Action.RESET}
)


def done(result):
    """Return a future that has a result."""
    future = Future()
    future.set_result(result)
    return future


def failed(error):
    """Return a future that has failed."""
    future = Future()
    future.set_exception(error)
    return future


def vehicle(name, x, y=0.0, z=0.0, **details):
    """Return a vehicle at a place."""
    known = {
        "position": (x, y, z),
        "pose_age": 0.02,
        "is_stale": False,
        "state": "on the ground",
        "battery": 3.97,
        "link_quality": 0.98,
        "rates": {"pose": 100.0},
        "actions": ACTIONS,
    }
    return VehicleSnapshot(name, **{**known, **details})


class FakeDashboard:
    """The part of `Dashboard` that pages call: carries out commands at once, and records them."""

    def __init__(self):
        self.pages = PageControl()
        self.reset()

    def reset(self):
        """Begin again with three vehicles on the ground, the third of them stale."""
        #: s. On a loaded machine a click comes late, which is no matter of most tests.
        self.max_age = 30.0
        self.commands = []
        self.emergencies = []
        self.flown = []
        self.fields_shown = []
        self.watched = ()
        self.made = []
        self.saved = {}
        self.history = History()
        self.typed = []
        self.picture = self.report_file = None
        self.refusals = {}
        self.recorded = (
            Recorded("2026-11-29_20-01-02", 75.4, 3_400_000, ("cf1", "cf2"), True),
            Recorded("2026-11-29_19-00-00", 12.0, 1_000_000, (), False),
        )
        self.is_slow = False  #: Whether vehicles stay where they are when they are commanded.
        self.tracked = Commands(time.monotonic)
        self.gain = ParameterInfo(
            "cf1/controller", "K/gain", "float", 0.5, "1/s", "gain of the height", 0.0, 2.0
        )
        stale = vehicle("cf3", 1.0, is_stale=True, pose_age=7.4, state="no pose")
        self.set_vehicles(vehicle("cf1", -1.0), vehicle("cf2", 0.0), stale)

    def set_vehicles(self, *vehicles, **details):
        """Show these vehicles."""
        pole = Marker(type=Marker.CYLINDER, scale=Vector3(0.2, 0.2, 1.5))
        pole.color, pole.pose.position = ColorRGBA(0.6, 0.7, 0.8, 1.0), Point(1.2, 1.2, 0.75)
        known = {
            "fences": (Placed(Box((-2.5, -2.5, 0.0), (2.5, 2.5, 2.2))),),
            "solids": (Placed(grouped([pole])[0][0][1]),),
            "images": ("/cf1/image_raw",),
            "frames": (Placed("wand", (-1.5, 1.2, 0.3), (0, 0, 0, 1)),),
            "sentences": (Sentence("warn", "doctor", "cf2 has a weak link", "move the antenna"),),
            "log": (
                LogLine(1, 12.0, "info", "/cf1/takeoff_server", "ready"),
                LogLine(2, 12.5, "warn", "/cf2/driver", "<b>link</b> at 40 %"),
            ),
        }
        self._scene = Scene(vehicles={each.name: each for each in vehicles}, **{**known, **details})

    def change(self, name, **details):
        """Change a vehicle."""
        vehicles = dict(self._scene.vehicles)
        vehicles[name] = vehicles[name]._replace(**details)
        self._scene = replace(self._scene, vehicles=vehicles)

    def scene(self):
        is_new = self._scene.made == math.inf
        scene = replace(self._scene, made=time.monotonic()) if is_new else self._scene
        self.history.add(scene)
        return scene

    def scene_at(self, moment):
        return self.history.at(moment)

    def events(self):
        return self.history.events

    def begin(self):
        return self.history.begin

    def watch(self, page, vehicles):
        self.watched = tuple(vehicles)

    def limits(self, vehicles):
        box = Box((-2.0, -2.0, 0.0), (2.0, 2.5, 3.0))
        return (box, "the room of the world file") if vehicles else None

    def plots(self, page, until=None):
        times = tuple(-60 + 0.1 * k for k in range(600))
        own = (
            Series("position z", "m", times, tuple(1 + 0.001 * k for k in range(600))),
            Series("error", "m", times, tuple(0.1 for _ in range(600))),
            Series("roll", "deg", times, tuple(0.0 for _ in range(600))),
            Series("battery", "V", times, tuple(4.0 - 0.0005 * k for k in range(600))),
        )
        fields = tuple(Series(path, "", (-1.0, 0.0), (1.0, 2.0)) for path in self.fields_shown)
        return {"": fields, **dict.fromkeys(self.watched, own)}

    def fields(self, vehicle):
        return {f"/{vehicle}/imu": ["x", "y"], f"/{vehicle}/state": ["state/x"]}

    def receive(self, page, paths):
        self.fields_shown = [*paths]

    def progress(self):
        return self.tracked.update(self._scene.vehicles)

    def command(self, page, command):
        places = {name: each.position for name, each in self._scene.vehicles.items()}
        number = self.tracked.begin(page, command.title, command.vehicles, places, command)
        answer = self._answer(page, command)
        self.tracked.answered(number, answer)
        return answer

    def _answer(self, page, command):
        age = time.monotonic() - command.clicked
        try:
            self.pages.expect_control(page)
        except RefusalError as error:
            return failed(error)
        if age > self.max_age:
            return failed(RefusalError(f"the click is {age:.0f} s old"))
        self.commands.append(command)
        outcomes = {name: self.refusals.get(name, "") for name in command.vehicles}
        for name, text in outcomes.items():
            if not (text or self.is_slow):
                self._carry_out(name, command)
        return done(outcomes)

    def emergency(self, vehicles, age):
        self.emergencies.append(vehicles)
        names = tuple(self._scene.vehicles) if vehicles is None else vehicles
        for name in names:
            self.change(name, is_in_flight=False, is_emergency=True, state="emergency")
        return done({name: self.refusals.get(name, "") for name in names})

    def _carry_out(self, name, command):
        x, y, _ = self._scene.vehicles[name].position
        if command.action is Action.TAKEOFF:
            there = (x, y, command.height)
            self.change(name, position=there, is_in_flight=True, state="hovering", reference=there)
        elif command.action is Action.LAND:
            self.change(name, position=(x, y, 0.0), is_in_flight=False, state="on the ground")
        elif command.action is Action.GO_TO:
            places = {each: self._scene.vehicles[each].position for each in command.vehicles}
            self.change(name, position=formation(places, command.goal)[name])

    def parameter_owners(self):
        return ("/cf1/controller", "cf1")

    def parameters(self, owner=None):
        if owner == "cf1":
            return done(
                tuple(
                    ParameterInfo(owner, f"group{k % 9}.value{k}", "int", k, is_firmware=True)
                    for k in range(300)
                )
            )
        return done(
            (self.gain, ParameterInfo("fence", "enabled", "bool", True, help="holds vehicles"))
        )

    def set_parameter(self, page, parameter, text):
        self.typed.append(text)
        try:
            value = float(text)
        except ValueError:
            return failed(RefusalError(f"{parameter.name} is {text!r}; expected a number"))
        if not 0 <= value <= 2:
            return failed(RefusalError(f"{parameter.name} is {text}; expected 0 to 2 1/s"))
        self.gain = replace(self.gain, value=value)
        return done(self.gain)

    def mission_files(self):
        return (
            Path("/missions/square.py"),
            Path("/trajectories/eight.csv"),
            *map(Path, self.saved),
        )

    def save_waypoints(self, name, points):
        self.saved[f"/waypoints/{name}.py"] = points
        return done(Path(f"/waypoints/{name}.py"))

    def dry_run(self, page, mission, vehicles):
        if mission.suffix == ".csv":
            return done(DryRunResult(False, "cf1 and cf2 come as near as 0.1 m at 3.2 s"))
        path = ((0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1))
        self._scene = replace(self._scene, paths={"cf1": path})
        return done(DryRunResult(True, "12.0 s, all land", {"cf1": path}))

    def forget_paths(self, page):
        self._scene = replace(self._scene, paths={})

    def fly(self, page, mission, vehicles, clicked):
        self.flown.append(str(mission))
        number = self.tracked.begin(
            page, f"fly {mission.name} with {', '.join(vehicles)}", vehicles, {}
        )
        self.tracked.follow(number)
        self.tracked.ended(number, done(""))
        return done("")

    def stop_mission(self, page, clicked):
        return done(None)

    def record(self, page, is_on):
        self._scene = replace(self._scene, recording="recording" if is_on else "")
        return done(None if is_on else "report.html")

    def report(self, names=()):
        return self.report_file if len(names) < 2 or names in self.made else None

    def recordings(self):
        return self.recorded

    def make_report(self, names):
        self.made.append(names)
        return done("report.html")

    def watch_image(self, page, topic):
        return done(None)

    def examine(self):
        return done(None)

    def image(self, page):
        return self.picture
