"""Checks of time, tf, and the delay from a pose to the control."""

import difflib
import itertools
import statistics
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field

from crazyflie_doctor.finding import Finding, error, listed, warn
from crazyflie_doctor.graph import Graph
from crazyflie_lqr.design import Design
from crazyflie_lqr.gain_file import GainFileError, load_matrix
from crazyflie_lqr.margins import loop_margins
from crazyflie_lqr.models import CONTROLS, LinearModel, full_state, near_hover

LEAST_RATE = 50.0  #: Below this rate of poses, Hz, velocities are poor.
#: Without a new pose for longer than this the vehicle is no longer controlled, s.
LONGEST_PAUSE = 0.1
LONGEST_AGE = 0.1  #: Older poses, s, are too late for a controller.

#: Stamps further ahead of the clock than this, s, are wrong: tf's own static_transform_publisher is
#: ahead by its period.
FUTURE = 0.5

#: Clocks that differ by more than this, s, are different clocks: simulated and real time.
OTHER_CLOCK = 1e6

#: Usable fraction of the delay margin; the rest is for the vehicle and for jitter.
USED_MARGIN = 2.0 / 3.0


@dataclass(frozen=True)
class Transform:
    """A transform that was received."""

    #: parent, child, node: Frames, and the publishing node.
    parent: str
    child: str
    node: str
    #: stamp, arrival: ROS time, s.
    stamp: float
    arrival: float
    is_static: bool = False  #: It came on /tf_static.


@dataclass
class TimingRecording:
    """Messages of some seconds."""

    transforms: list[Transform] = field(default_factory=list)  #: In the order in which they came.
    clocks: list[float] = field(default_factory=list)  #: Times on /clock (s).
    #: Topic of controls -> times from stamp to arrival, s.
    delays: dict[str, list[float]] = field(default_factory=dict)
    #: Topic of controls -> stamps, s.
    control_stamps: dict[str, list[float]] = field(default_factory=dict)
    #: Address of a vehicle -> nodes whose diagnostics report it.
    reported: dict[str, set[str]] = field(default_factory=dict)

    @property
    def streams(self) -> dict[str, list[Transform]]:
        """Child frame -> its transforms."""
        found = defaultdict(list)
        for t in self.transforms:
            found[t.child].append(t)
        return dict(sorted(found.items()))

    def path_up(self, frame: str) -> list[str]:
        """Return a frame and those above it; in a loop the last one comes twice."""
        parent = {t.child: t.parent for t in self.transforms}
        path = [frame]
        while path[-1] in parent and path[-1] not in path[:-1]:
            path.append(parent[path[-1]])
        return path


def check_clock(graph: Graph, recording: TimingRecording) -> Iterator[Finding]:
    """Check that all nodes use one clock, and that it advances."""
    sources = graph.publishers.get("/clock", set())
    if graph.parameters.get("/use_sim_time", False):
        if not recording.clocks:
            yield error(
                "/use_sim_time is true, but nothing comes on /clock: time stands still",
                "start a simulator with sim_time:=true, or rosparam set /use_sim_time false and "
                "restart the nodes",
            )
        elif recording.clocks[-1] == recording.clocks[0]:
            yield error("/clock stands still", "is the simulation or rosbag paused?")
        if len(sources) > 1:
            yield error(f"/clock comes from {listed(sources)}", "end all but one")
    elif sources:
        yield error(
            f"{listed(sources)} publishes /clock, but /use_sim_time is not true",
            "rosparam set /use_sim_time true and restart the nodes, or end the simulation",
        )
    strangers = {
        t.node
        for t in recording.transforms
        if not t.is_static and abs(t.arrival - t.stamp) > OTHER_CLOCK
    }
    if strangers:
        yield error(
            f"{listed(strangers)} stamps transforms by another clock than this graph's",
            "restart it: nodes read /use_sim_time when they start",
        )


def check_tf_tree(_: Graph, recording: TimingRecording) -> Iterator[Finding]:
    """Find frames with two parents or two publishers, and loops."""
    for child, transforms in recording.streams.items():
        parents, nodes = {t.parent for t in transforms}, {t.node for t in transforms}
        if len(parents) > 1:
            yield error(
                f"{child} has the parents {listed(parents)}, from {listed(nodes)}",
                "end one of them, or rename its frame: tf takes whichever came last",
            )
        elif len(nodes) > 1:
            is_static = any(t.is_static for t in transforms)
            kind = "static transform" if is_static else "transform"
            yield error(f"the {kind} of {child} comes from {listed(nodes)}", "end all but one")
    looped: set[str] = set()
    for child in recording.streams:
        path = recording.path_up(child)
        loop = path[path.index(path[-1]) :]
        if len(loop) > 1 and looped.isdisjoint(loop):
            looped.update(loop)
            yield error(f"tf has a loop: {' -> '.join(loop)}", "invert one of these transforms")


def check_frames(graph: Graph, recording: TimingRecording) -> Iterator[Finding]:
    """Find frames, and pairs of frames, that nodes need and no node publishes."""
    known = {frame for t in recording.transforms for frame in (t.parent, t.child)}
    for node, (fixed, robot) in sorted(frames_of(graph).items()):
        missing = sorted({fixed, robot} - known)
        for frame in missing:
            near = difflib.get_close_matches(frame, known, 1, 0.5)
            hint = f"did you mean {near[0]}?" if near else f"there are {listed(known) or 'none'}"
            yield error(
                f"no node publishes the frame {frame} that {node} needs ({hint})",
                "correct its parameter or the child_frame_id of the rigid body; does motion "
                "capture see it?",
            )
        if not missing and fixed not in recording.path_up(robot):
            yield error(
                f"tf does not connect {fixed} and {robot}, which {node} needs",
                "publish the missing transform between them",
            )


def frames_of(graph: Graph) -> dict[str, tuple[str, str]]:
    """Return node -> (fixed frame, frame of its vehicle), as its parameters say."""
    pairs = (("frames/fixed", "frames/robot"), ("worldFrame", "frame"))
    found = {}
    for fixed_name, robot_name in pairs:
        for name, value in graph.parameters.items():
            node = name.removesuffix(f"/{robot_name}")
            fixed = graph.parameters.get(f"{node}/{fixed_name}")
            # Parameters that an ended launch has left need no frames.
            if node != name and isinstance(fixed, str) and isinstance(value, str):
                found[node] = (fixed.strip("/"), value.strip("/"))
    return found


def check_tf_rate(graph: Graph, recording: TimingRecording) -> Iterator[Finding]:
    """Check rate, pauses and age of the poses of every vehicle."""
    streams = recording.streams
    poses = set()
    for fixed, robot in frames_of(graph).values():
        path = recording.path_up(robot)
        if chain := path[: path.index(fixed)] if fixed in path else []:
            # The fastest transform between vehicle and fixed frame is the pose; the others may be
            # constant: tf's own static_transform_publisher repeats them ten times a second.
            poses.add(max(chain, key=lambda child: _rate(streams[child])))
    for child in sorted(poses):
        yield from _check_stream(child, streams[child])


def _rate(transforms):
    stamps = {t.stamp for t in transforms if not t.is_static}
    return (len(stamps) - 1) / (max(stamps) - min(stamps)) if len(stamps) > 1 else 0.0


def _check_stream(child, transforms):
    what = f"{child}, from {listed({t.node for t in transforms})},"
    mend = "look at motion capture's rate, its view of the vehicle, and the network"
    stamps = sorted({t.stamp for t in transforms if not t.is_static})
    pauses = [after - before for before, after in itertools.pairwise(stamps)]
    if not pauses:
        yield error(f"{what} stands still: one stamp only", mend)
        return
    rate = _rate(transforms)
    if rate < LEAST_RATE:
        level = error if rate < 1.0 / LONGEST_PAUSE else warn
        yield level(f"{what} comes at {rate:.1f} Hz, expected {LEAST_RATE:g} or more", mend)
    elif max(pauses) > LONGEST_PAUSE:
        yield warn(f"{what} pauses for {max(pauses):.2f} s", mend)
    age = statistics.median(t.arrival - t.stamp for t in transforms)
    if LONGEST_AGE < age < OTHER_CLOCK:
        yield error(
            f"{what} is {age:.2f} s old when it comes",
            "synchronise the computers' clocks (chrony), or stamp poses on arrival",
        )
    elif -OTHER_CLOCK < age < -FUTURE:
        yield error(f"{what} is {-age:.2f} s ahead of the clock", "synchronise the clocks (chrony)")


def check_gains(graph: Graph, recording: TimingRecording) -> Iterator[Finding]:
    """Compare the delay from pose to control with what the gains in use tolerate.

    The loop's delay is the measured time from the pose's stamp, plus half of the period for which
    each control is held.
    """
    for node, path, x_dim, topic in _controllers(graph):
        model = {7: near_hover, 12: full_state}.get(x_dim)
        delays = recording.delays.get(topic, [])
        stamps = sorted(set(recording.control_stamps.get(topic, [])))
        if model is None or len(stamps) < 2 or max(delays) > OTHER_CLOCK:
            continue
        period = statistics.median(b - a for a, b in itertools.pairwise(stamps))
        delay = statistics.median(delays) + 0.5 * period
        try:
            margin, loop = delay_margin(path, model())
        except GainFileError as complaint:
            yield error(f"{node}: {complaint}", "restart the controller with a good K_file")
            continue
        if delay > USED_MARGIN * margin:
            yield (error if delay > margin else warn)(
                f"{node} acts {delay * 1e3:.1f} ms after the pose; with {path} {loop} is unstable "
                f"at {margin * 1e3:.1f} ms",
                "design gains for this delay (rosrun crazyflie_lqr design_gains --help) or use "
                "softer ones; a busy computer also makes controls late",
            )


def _controllers(graph):
    for name, path in sorted(graph.parameters.items()):
        node = name.removesuffix("/K_file")
        x_dim = graph.parameters.get(f"{node}/x_dim")
        topic = graph.parameters.get(f"{node}/topics/control")
        if node != name and isinstance(topic, str):
            yield node, path, x_dim, "/" + topic.strip("/")


def delay_margin(path: str, model: LinearModel) -> tuple[float, str]:
    """Return the delay, s, at which the gains in a file make a loop unstable, and that loop."""
    design = Design(load_matrix(path, model.u_dim, model.x_dim), model.A, model.B, 0.0)
    return min((loop_margins(design, k).delay, name) for k, name in enumerate(CONTROLS))
