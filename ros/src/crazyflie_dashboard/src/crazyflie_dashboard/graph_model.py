"""The running graph as a `Scene`: vehicles that come and go, the world, log and diagnostics.

Nothing is subscribed to, and the master is not asked, while no page is open.
"""

import itertools
import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future

from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Log
from tf2_msgs.msg import TFMessage

from crazyflie_dashboard.discovery import FoundVehicle, Graph, vehicles
from crazyflie_dashboard.frames import Frames
from crazyflie_dashboard.history import History
from crazyflie_dashboard.master import Master
from crazyflie_dashboard.messages import Diagnostics, log_line
from crazyflie_dashboard.page_state import IMAGES
from crazyflie_dashboard.snapshot import (
    STALE_AGE,
    LogLine,
    Placed,
    Scene,
    Sentence,
    Step,
    Triple,
    VehicleSnapshot,
)
from crazyflie_dashboard.surroundings import Surroundings
from crazyflie_dashboard.vehicle_model import VehicleModel, frame_of
from crazyflie_takeoff.envelope import Box
from crazyflie_utils import NodeHandle
from crazyflie_utils.refusal import listed
from crazyflie_utils.tf.frame_tree import RawTransforms, StampedPose
from crazyflie_utils.tf.transforms import MAX_FUTURE_STAMP, MAX_FUTURE_STAMP_SIMULATED

SCENE_PERIOD = 0.05  #: Period of scenes (s).
_POLL_PERIOD = 2.0  #: Shortest period of requests to the master (s).
_POLL_SHARE = 0.02  #: Largest fraction of time that requests to the master take.
_FORGET_AFTER = 30.0  #: Time for which a vehicle is shown after its topics have gone (s).
#: With more vehicles than this, references and controls are received from watched ones only.
_FEW = 10
#: Time for which subscriptions are kept after the last page has gone (s): a page that is loaded
#: again shows vehicles also without a master.
_LINGER_TIME = 10.0
_MAX_LINES = 500  #: Lines of the log.

_OLDER = "an older pose is shown"
_CLOCKS = "set the clocks of both computers, or look for what is slow"
_REMEDIES = {"is stamped in the future": f"{_OLDER}; {_CLOCKS}"}


class GraphModel:
    """The running graph. Not thread-safe, except ``scene``, ``graph`` and ``models``.

    Threads of ``workers`` may wait for the master.
    """

    def __init__(
        self,
        handle: NodeHandle,
        workers: Executor,
        master: Master,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.scene = Scene()  #: The newest one.
        self.graph = Graph()  #: The newest one.
        self.models: dict[str, VehicleModel] = {}  #: By name of the vehicle.
        #: paths, sentences, missions, recording: Parts of the scene that are set from outside.
        self.paths: Mapping[str, tuple[Triple, ...]] = {}
        self.sentences: tuple[Sentence, ...] = ()
        self.missions: Callable[[], tuple[tuple[str, ...], tuple[Step, ...]]]
        self.missions = lambda: ((), ())
        self.recording: Callable[[], tuple[str, str]] = lambda: ("", "")
        #: Called with each new scene.
        self.on_scene: Callable[[Scene], object] = lambda scene: None
        #: handle, workers, master, clock: Also of those that command what is here.
        self.handle, self.workers, self.master, self.clock = handle, workers, master, clock
        self._subscriptions: NodeHandle | None = None
        ahead = MAX_FUTURE_STAMP_SIMULATED if handle.uses_sim_time else MAX_FUTURE_STAMP
        self.frames = Frames(clock, handle.nanoseconds, ahead)
        self._diagnostics = Diagnostics(clock)
        self._surroundings = Surroundings(handle)
        self._log: deque[LogLine] = deque(maxlen=_MAX_LINES)
        self._numbers = itertools.count(1)
        self._watched: set[str] = set()
        self.history = History()
        self._poll_at = 0.0  # Infinite while the master is asked.
        self._end_at = math.inf
        self._known_frames = 0
        self._images: tuple[str, ...] = ()  # Topics of cameras.
        self._trouble = ""  #: Reason why there is no newer graph.

    def begin(self) -> None:
        """Start to observe the graph: a page is open."""
        self._end_at = math.inf
        if self._subscriptions is not None:
            return
        handle = self._subscriptions = self.handle.child()
        self.frames.clear()
        self._surroundings = Surroundings(handle)
        self._poll_at = 0.0
        handle.subscribe("/tf", RawTransforms, lambda message: self.frames.read(message.raw))
        handle.subscribe("/tf_static", TFMessage, self._on_static)
        handle.subscribe("/rosout_agg", Log, self._on_log)
        handle.subscribe("/diagnostics", DiagnosticArray, self._diagnostics.take)
        handle.timer(SCENE_PERIOD, self._on_timer, steady=True)

    def end(self) -> None:
        """Observe the graph for a little longer: no page is open, or one is being reloaded."""
        self._end_at = self.clock() + _LINGER_TIME

    def _forget(self):
        for model in self.models.values():
            model.close()
        if self._subscriptions is not None:
            self._subscriptions.close()
        self._subscriptions = None
        self.models, self.scene, self.graph = {}, Scene(), Graph()

    def watch(self, names: set[str]) -> None:
        """Receive frequent messages for these vehicles only."""
        self._watched = names
        self._receive()

    def fence(self, vehicle: FoundVehicle) -> Box | None:
        """Return the geofence of a vehicle, in the frame of its states; None if it has none."""
        return self._surroundings.box(vehicle.namespace)

    def room(self) -> Box | None:
        """Return the room of the world file, in the fixed frame; None without one."""
        return self._surroundings.room(self.scene.fixed_frame)

    def _receive(self):
        """Subscribe to the topics that are shown for each vehicle."""
        is_few = len(self.models) <= _FEW
        for name, model in self.models.items():
            model.frame = frame_of(model.vehicle, self.frames, len(self.models) == 1)
            was_plotted = model.plots is not None
            model.receive(name in self._watched, is_few, self.graph.topics)
            if model.plots is not None and not was_plotted:
                model.plots.fill(self.history.of(name))

    def _on_timer(self):
        if self.clock() >= self._end_at:
            self._forget()
            return
        if (began := self.clock()) >= self._poll_at:
            self._poll_at = math.inf
            self.workers.submit(self.master.graph).add_done_callback(
                lambda done: self.handle.submit(self._on_graph, done, began)
            )
        self.frames.update()
        if len(self.frames.poses) != self._known_frames:
            self._known_frames = len(self.frames.poses)
            self._receive()
        self.scene = self._make_scene()
        self.history.add(self.scene)
        self.on_scene(self.scene)

    def _on_graph(self, done: "Future[Graph]", began: float) -> None:
        now = self.clock()
        self._poll_at = now + max(_POLL_PERIOD, (now - began) / _POLL_SHARE)
        if self._subscriptions is None:
            return
        # Without a master, the last known data are shown, with their growing age.
        if done.exception() is not None:
            self._trouble = f"no graph: {done.exception()}"
            self.handle.warn(self._trouble, throttle=60.0)
            return
        self._trouble = ""
        self.graph = done.result()
        topics = self.graph.topics.items()
        self._images = tuple(sorted(topic for topic, kind in topics if kind in IMAGES))
        self._update_vehicles(vehicles(self.graph), now)
        self._surroundings.follow(self.graph)

    def _update_vehicles(self, found: list[FoundVehicle], now: float) -> None:
        gone, models = dict(self.models), {}
        for vehicle in found:
            model = gone.pop(vehicle.name, None)
            if model is None or model.vehicle.topics != vehicle.topics:
                plots = None if model is None else model.plots
                if model is not None:
                    model.close()
                model = VehicleModel(self.handle.child(), vehicle, self.clock, plots)
            model.vehicle, model.seen = vehicle, now
            model.kind = self._diagnostics.kind(vehicle)
            models[vehicle.name] = model
        for name, model in gone.items():
            if now - model.seen > _FORGET_AFTER:
                model.close()
            else:
                models[name] = model
        # At once: the emergency of a page reads it in another thread.
        self.models = models
        self._receive()

    def _on_static(self, message):
        for transform in message.transforms:
            self.frames.read_static(StampedPose.of(transform))

    def _on_log(self, message):
        self._log.append(log_line(next(self._numbers), message))

    def _make_scene(self) -> Scene:
        frames = self.frames
        own = {model.frame for model in self.models.values()} - {None}
        roots = [frames.root(str(frame)) for frame in own or frames.poses]
        fixed = max(sorted(set(roots)), key=roots.count, default="world")
        wrong = {each.name: each.message for each in self._diagnostics.wrong()}
        held = self._surroundings.held
        for name, model in self.models.items():
            model.now = self._snapshot(name, fixed, wrong, held)
            if model.plots is not None:
                model.plots.take_pose(model.now, "state" in model.vehicle.topics)
        (running, steps), (recording, recorded) = self.missions(), self.recording()
        others = []
        for name in frames.poses.keys() - own:
            pose = frames.in_fixed(name, fixed)
            if pose is not None and frames.parent(name) not in own:
                others.append(Placed(name, *pose))
        return Scene(
            made=self.clock(),
            fixed_frame=fixed,
            vehicles={name: model.now for name, model in self.models.items()},
            solids=self._surroundings.solids(frames, fixed),
            fences=self._surroundings.fences(
                frames, fixed, {m.vehicle.namespace: m.frame for m in self.models.values()}
            ),
            frames=tuple(others),
            paths={**self._surroundings.paths(frames, fixed), **self.paths},
            sentences=self._own_sentences() + self._diagnostics.sentences() + self.sentences,
            log=tuple(self._log),
            images=self._images,
            missions=running,
            steps=steps,
            recording=recording,
            recorded=recorded,
        )

    def _snapshot(self, name, fixed, wrong, held):
        """Return the snapshot of a vehicle; one that cannot be drawn must not stop the others."""
        try:
            model = self.models[name]
            now = model.snapshot(self.frames, fixed)
            fence = f"{model.vehicle.namespace}/geofence: certificate".lstrip("/")
            if not now.reason and fence in wrong:
                now = now._replace(reason=wrong[fence])
            return now._replace(is_held=True) if name in held else now
        except Exception as error:
            self.handle.warn(f"{name} cannot be shown: {error}", throttle=10.0, key=name)
            return VehicleSnapshot(name, state="cannot be shown", reason=str(error))

    def _own_sentences(self):
        found = []
        if self._trouble:
            remedy = "new vehicles are not seen, and those that are gone stay"
            found.append(Sentence("error", "dashboard", self._trouble, remedy))
        for text in self._surroundings.too_many:
            found.append(Sentence("warn", "markers", text, "publish fewer, or larger ones"))
        for frame, reason in sorted(self.frames.rejected.items()):
            text = f"the newest pose of {frame} on /tf {reason}"
            found.append(Sentence("error", "dashboard", text, _REMEDIES.get(reason, _OLDER)))
        late = [n for n, p in self.frames.poses.items() if p.delay > STALE_AGE and not p.is_static]
        if late:
            delay = max(self.frames.poses[name].delay for name in late)
            text = f"poses of {listed(sorted(late))} come {delay:.1f} s after their stamps"
            found.append(Sentence("error", "dashboard", text, _CLOCKS))
        return tuple(found)
