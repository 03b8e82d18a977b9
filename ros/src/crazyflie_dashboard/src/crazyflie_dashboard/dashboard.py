"""The dashboard of the running graph."""

import contextlib
import time
from collections.abc import Callable, Collection, Generator, Iterable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import rospkg

from crazyflie_dashboard import missions, waypoints
from crazyflie_dashboard.actions import Actions, expect_fresh
from crazyflie_dashboard.control import PageControl
from crazyflie_dashboard.emergency import EmergencyLane
from crazyflie_dashboard.graph_model import GraphModel
from crazyflie_dashboard.history import Event
from crazyflie_dashboard.live_parameters import LiveParameters
from crazyflie_dashboard.master import Master
from crazyflie_dashboard.messages import examine
from crazyflie_dashboard.page_data import (
    Command,
    DryRunResult,
    Outcomes,
    ParameterInfo,
    Series,
    words,
)
from crazyflie_dashboard.page_state import PageState
from crazyflie_dashboard.plots import fields_of
from crazyflie_dashboard.progress import Commands, Progress, Stage
from crazyflie_dashboard.recording import Recorded, Recording
from crazyflie_dashboard.snapshot import Scene
from crazyflie_takeoff.envelope import Box
from crazyflie_utils import NodeHandle, ServiceError
from crazyflie_utils.refusal import RefusalError, listed
from crazyflie_utils.steps import follow

_COMPARE_PERIOD = 0.2  #: Period in which commands are compared with what vehicles do (s).


class Dashboard:
    """The graph, as pages see and command it; requests are carried out in the node's turn.

    Every method may be called from any thread, and does not wait. Lengthy methods return a future,
    which fails with `RefusalError`, whose text is for the operator; if a service has refused, it is
    the service's text.

    The lane is closed with the dashboard; ``folders`` have missions and trajectories; threads of
    ``workers`` may wait; for ``reach`` see `Actions`.
    """

    def __init__(
        self,
        handle: NodeHandle,
        master: Master,
        lane: EmergencyLane,
        folders: list[str],
        clock: Callable[[], float] = time.monotonic,
        workers: Executor | None = None,
        reach: float = 10.0,
    ):
        #: Opens and closes every page; a method's ``page`` is its number.
        self.pages = PageControl()
        #: Folder of missions that are made of waypoints.
        self._waypoints = Path(rospkg.get_ros_home(), "crazyflie_waypoints")
        self._handle, self._clock = handle, clock
        self._folders = [*folders, str(self._waypoints)]
        self._workers = workers or ThreadPoolExecutor(8, "dashboard")
        # A thread that submits work to an idle node also carries out the queue: this thread does
        # so, not the one that serves all pages.
        self._turns = workers or ThreadPoolExecutor(1, "dashboard_turns")
        self._model = GraphModel(handle, self._workers, master, clock)
        self._actions = Actions(self._model, reach)
        self._commands = Commands(clock, self._log_end)
        self._compared = 0.0  # When commands were last compared with a scene (s).
        self._model.on_scene = self._compare
        self._lane = lane
        self._parameters = LiveParameters(self._model)
        self._missions = missions.Missions()
        self._model.missions = lambda: (self._missions.running, self._missions.steps)
        self._recording = Recording()
        self._model.recording = lambda: (self._recording.text, self._recording.length)
        self._open: dict[int, PageState] = {}
        self.pages.log = handle.info
        self.pages.on_change = lambda: self._submit(self._follow_pages)

    def close(self) -> None:
        """End all activities that were started here, except flights."""
        self._actions.close()
        self._lane.close()
        self._recording.close()
        for each in (self._turns, self._workers):
            each.shutdown(wait=False, cancel_futures=True)

    def scene(self) -> Scene:
        """Return the newest scene, made 20 times a second while a page is open."""
        return self._model.scene

    def scene_at(self, time: float) -> Scene | None:
        """Return the scene of a time (s) within the last `history.SPAN`; None without one."""
        return self._model.history.at(time)

    def events(self) -> tuple[Event, ...]:
        """Return what has happened in that time: of vehicles, missions and the recording."""
        return self._model.history.events

    def begin(self) -> float | None:
        """Return the time of the oldest scene (s)."""
        return self._model.history.begin

    def watch(self, page: int, vehicles: Iterable[str]) -> None:
        """Choose the vehicles whose plots a page shows."""

        def do():
            self._page(page).vehicles = tuple(vehicles)
            self._update_watched()

        self._submit(do)

    def plots(self, page: int, until: float | None = None) -> dict[str, tuple[Series, ...]]:
        """Return the minute until a time (s), now by default, of each vehicle that a page watches.

        The page's own fields are those of "".
        """
        state, now = self._open.get(page), self._clock() if until is None else until
        if state is None:
            return {}
        found = {"": state.series(now)}
        for name in state.vehicles:
            model = self._model.models.get(name)
            if model is not None and model.plots is not None:
                found[name] = model.plots.series(now)
        return found

    def fields(self, vehicle: str) -> dict[str, tuple[str, ...]]:
        """Return the topics of a vehicle, each with its fields that are numbers."""
        model, topics = self._model.models.get(vehicle), self._model.graph.topics
        if model is None:
            return {}
        space = f"{model.vehicle.namespace}/"
        own = {topic: kind for topic, kind in sorted(topics.items()) if topic.startswith(space)}
        return {topic: found for topic, kind in own.items() if (found := fields_of(kind))}

    def receive(self, page: int, paths: Collection[str]) -> None:
        """Choose the numbers of topics that a page plots, each as in /topic/field/field."""

        def do():
            if page in self._open:
                self._open[page].receive(paths, self._model.graph.topics)

        self._submit(do)

    def command(self, page: int, command: Command) -> "Future[Outcomes]":
        """Carry out a command of the page that has control; return an outcome for each vehicle.

        An emergency is none: it has a way of its own, `emergency`.
        """
        number = self._begin_progress(page, command.title, command.vehicles, command)
        outcome = self._begin(page, command.words, self._actions.carry_out, command)
        outcome.add_done_callback(lambda done: self._commands.answered(number, done))
        return outcome

    def limits(self, vehicles: Iterable[str]) -> tuple[Box, str] | None:
        """Return where goals of these vehicles may be (m), and what limits them, in words."""
        return self._actions.limits(vehicles)

    def progress(self) -> tuple[Progress, ...]:
        """Return the last commands and missions of all pages, and what has become of them."""
        return self._commands.rows

    def emergency(self, vehicles: tuple[str, ...] | None, age: float) -> "Future[Outcomes]":
        """Stop motors, of all vehicles if ``vehicles`` is None; the page does not need control.

        The call waits for no other command and for no turn. ``age`` (s) is that of the click. The
        future has an outcome for each service, after `MAX_EMERGENCY_AGE` at the latest.
        """
        if vehicles is None:
            return self._lane.stop(None, age)
        services: list[str] = []
        for name in vehicles:
            model = self._model.models.get(name)
            found = () if model is None else model.vehicle.emergencies
            services += found or [f"/{name}/emergency".replace("///", "/")]
        return self._lane.stop(services, age)

    def parameter_owners(self) -> tuple[str, ...]:
        """Return nodes with live parameters, and vehicles with firmware parameters."""
        return self._parameters.owners()

    def parameters(self, owner: str) -> "Future[tuple[ParameterInfo, ...]]":
        """Return the live parameters of a node or of a vehicle's firmware."""
        return self._do(self._parameters.of, owner)

    def set_parameter(
        self, page: int, parameter: ParameterInfo, text: str
    ) -> "Future[ParameterInfo]":
        """Set a parameter to the typed value; the result has the value that came back."""
        what = f"set {parameter.name} of {parameter.owner} to {text!r}"
        return self._control(page, what, self._parameters.set, parameter, text)

    def mission_files(self) -> tuple[Path, ...]:
        """Return the missions and trajectories that can be flown."""
        return missions.listed(self._folders)

    def save_waypoints(self, name: str, points: waypoints.Points) -> "Future[Path]":
        """Save waypoints (m) as a mission of a name; return its file."""
        return self._do(waypoints.save, self._waypoints, name, points)

    def dry_run(
        self, page: int, mission: Path, vehicles: tuple[str, ...]
    ) -> "Future[DryRunResult]":
        """Fly a mission with ideal vehicles that stand where the real ones are."""

        def do():
            self.pages.expect_control(page)
            result = yield self._missions.dry_run(mission, vehicles, self._places(vehicles))
            self._model.paths = result.paths
            return result

        return self._do(do)

    def forget_paths(self, page: int) -> None:
        """Remove the paths of the last dry run from the scene, if the page has control."""

        def do():
            if self.pages.controller == page:
                self._model.paths = {}

        self._submit(do)

    def fly(
        self, page: int, mission: Path, vehicles: tuple[str, ...], clicked: float
    ) -> "Future[str]":
        """Fly a mission after its dry run has passed; the future is done when it has ended."""
        title = f"fly {mission.name} with {listed(vehicles)}"
        number = self._begin_progress(page, title, vehicles)

        def do():
            expect_fresh(mission.name, self._clock() - clicked)
            end = self._missions.fly(mission, vehicles, self._places(vehicles))
            self._commands.follow(number)
            return end

        outcome = self._begin(page, f"fly {mission} for {listed(vehicles)}", do)
        outcome.add_done_callback(lambda done: self._commands.ended(number, done))
        return outcome

    def stop_mission(self, page: int, clicked: float) -> "Future[None]":
        """End the mission that flies; its vehicles land."""

        def do():
            expect_fresh("stop", self._clock() - clicked)
            self._missions.stop()

        return self._control(page, "stop the mission", do)

    def record(self, page: int, is_on: bool) -> "Future[str | None]":
        """Start or end a recording; at the end the future is done when the report exists."""
        if is_on:
            return self._control(page, "record", self._recording.start)
        return self._control(page, "stop recording", self._recording.stop)

    def recordings(self) -> tuple[Recorded, ...]:
        """Return the recordings in the folder of recordings, the newest first."""
        return self._recording.known()

    def report(self, names: tuple[str, ...] = ()) -> Path | None:
        """Return the report on one recording or two; by default on the last one ended here."""
        return self._recording.report_on(names) if names else self._recording.report

    def make_report(self, names: tuple[str, ...]) -> "Future[str]":
        """Make a report on a recording, or on two that are compared."""
        return self._do(lambda: self._workers.submit(self._recording.make_report, names))

    def examine(self) -> "Future[None]":
        """Run the doctor on the graph: its findings are in the scene 10 s later."""

        def do():
            self._model.sentences = yield self._workers.submit(examine)

        return self._do(do)

    def watch_image(self, page: int, topic: str | None) -> "Future[None]":
        """Choose the camera that a page shows."""
        return self._do(lambda: self._page(page).watch_image(topic, self._model.graph.topics))

    def image(self, page: int) -> bytes | str | None:
        """Return the newest picture of the page's camera, as JPEG or PNG, or the refusal."""
        state = self._open.get(page)
        return None if state is None else state.image

    def _submit(self, work: Callable[..., None], *arguments: Any) -> None:
        # A page may be closed after the dashboard.
        with contextlib.suppress(RuntimeError):
            self._turns.submit(self._handle.submit, work, *arguments)

    def _do(self, work: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Do work in the node's turn; the future has its result, or that of its future or steps."""
        turn: Future[None] = Future()

        def steps():
            yield turn
            try:
                result = work(*arguments)
                if isinstance(result, Generator):
                    return (yield from result)
                return (yield result) if isinstance(result, Future) else result
            except (OSError, ServiceError) as error:
                raise RefusalError(words(error)) from None

        outcome = follow(steps(), self._handle.submit)
        self._submit(turn.set_result, None)
        return outcome

    def _control(
        self, page: int, what: str, work: Callable[..., Any], *arguments: Any
    ) -> "Future[Any]":
        """Do work as `_do` for the page that has control; log the request and its outcome."""

        def log(done):
            error = done.exception()
            self._log(bool(error), f"page {page}: {what}: {words(error) if error else 'done'}")

        outcome = self._begin(page, what, work, *arguments)
        outcome.add_done_callback(log)
        return outcome

    def _begin(
        self, page: int, what: str, work: Callable[..., Any], *arguments: Any
    ) -> "Future[Any]":
        """Do work as `_do` for the page that has control; log the request."""

        def do():
            self.pages.expect_control(page)
            return work(*arguments)

        self._handle.info(f"page {page}: {what}")
        return self._do(do)

    def _log_end(self, row: Progress) -> None:
        self._log(row.stage is not Stage.DONE, f"page {row.page}: {row.text}: {row.outcome}")

    def _log(self, is_bad: bool, text: str) -> None:
        (self._handle.warn if is_bad else self._handle.info)(text)

    def _begin_progress(self, page, title, vehicles, command=None):
        return self._commands.begin(page, title, vehicles, self._places(vehicles), command)

    # Called in the node's turn.

    def _compare(self, scene):
        if scene.made - self._compared >= _COMPARE_PERIOD:
            self._compared = scene.made
            self._commands.update(scene.vehicles)

    def _places(self, names):
        known = self._model.scene.vehicles
        return {n: known[n].position for n in names if n in known and known[n].position}

    def _page(self, number):
        self.pages.expect_open(number)
        return self._open.setdefault(number, PageState(self._handle, self._workers, self._clock))

    def _follow_pages(self):
        pages = self.pages.pages
        for number in self._open.keys() - {*pages}:
            self._open.pop(number).close()
        self._update_watched()
        (self._model.begin if pages else self._model.end)()

    def _update_watched(self):
        self._model.watch({name for page in self._open.values() for name in page.vehicles})
