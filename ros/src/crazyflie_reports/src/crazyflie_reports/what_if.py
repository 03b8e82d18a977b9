"""What a recorded flight would have been with other parameters, other nodes, or today's code.

In open loop, nodes are given what was recorded, and what they publish is laid over what was
published then. In closed loop (--closed), a model of the vehicle flies by their controls, from the
recorded state on, in the wind that the recording shows. The page has both flights on each plot and
in the replay. The exit status is 1 if a figure gets worse than normal, 2 if nothing can be said.
"""

import argparse
import contextlib
import io
import math
import sys
import tempfile
from dataclasses import dataclass, field, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import genpy
import numpy as np
import rosbag
import yaml
from std_srvs.srv import EmptyRequest

from crazyflie_reports import bag_log, flight_input
from crazyflie_reports.bag_file import BagError
from crazyflie_reports.bag_flights import MARGIN, Flight, flights, frame_of, vehicle_namespaces
from crazyflie_reports.bag_report import PAGE, Report, ReportError
from crazyflie_reports.bag_topics import role_of
from crazyflie_reports.figures import Figure, figures_of_motion
from crazyflie_reports.flight_input import FlightInput, InputError
from crazyflie_reports.flown_model import IDEAL, Explained, FlownModel, VehicleModel, explain
from crazyflie_reports.laid_over import add_controls, lay_over
from crazyflie_reports.rerun import TF, Interface, Rerun, interface, remove_effects
from crazyflie_utils.journal.journal_file import JournalError
from crazyflie_utils.parameters.declaration import ParameterError
from crazyflie_utils.program import load
from crazyflie_utils.vectors import to_tuple

WORSE, FAILED = 1, 2  #: Exit statuses.
#: The other flight, and that of journals, in the folder of the result.
BAG, RECORDED = "what_if.bag", "recorded.bag"
#: Launch files with nodes and parameters of recordings that have none, simulated or driven.
LAUNCH = {False: "crazyflie_examples/sw_hover.launch", True: "crazyflie_examples/hw_hover.launch"}
_SHARED = ("/tf", "/tf_static", "/rosout", "/diagnostics", "/flights")  # In no namespace.
_NOTHING = 1e-6  # Of mm, s or V: a rounding error.
_BEFORE = 0.1  # Time before the takeoff at which a closed loop begins, s.


@dataclass
class Options:
    """What is asked for; see `main`."""

    recording: Path
    values: dict[str, Any] = field(default_factory=dict)  #: By "NODE/PARAM".
    nodes: tuple[str, ...] = ()  #: Parts of the nodes' names; all without any.
    is_closed: bool = False
    #: begin, end: Part of the recording, s since its first message.
    begin: float | None = None
    end: float | None = None
    launch: tuple[str, ...] = ()  #: A launch file and its arguments, as "NAME:=VALUE".
    model: str = ""  #: One of `flown_model.IDEAL`, a type of vehicle, or a model file.
    vehicle: str = ""  #: Its namespace.


@dataclass
class Change:
    """A figure of a flight as it was recorded, and as it would have been."""

    before: Figure
    after: Figure

    @property
    def is_worse(self) -> bool:
        """Whether it is not normal, and further from normal than it was, or not known any more."""
        if math.isnan(self.after.value):
            return bool(self.before.normal) and not math.isnan(self.before.value)
        return _excess(self.before, self.after.value) > _excess(self.before, self.before.value)


def _excess(figure, value):
    return 0.0 if math.isnan(value) else max(figure.minimum - value, value - figure.maximum, 0.0)


@dataclass
class Result:
    """A comparison of flights."""

    report: Report
    changes: list[tuple[str, list[Change]]]  #: Names of flights, and their figures.

    @property
    def is_worse(self) -> bool:
        """Whether a figure is worse than normal."""
        return any(each.is_worse for _, changes in self.changes for each in changes)

    def table(self) -> str:
        """Return a line for each figure that is known."""
        lines = []
        for name, changes in self.changes:
            lines.append(f"{name:<42}{'recorded':>10}{'what if':>10}  unit")
            for each in changes:
                if math.isnan(each.before.value) and math.isnan(each.after.value):
                    continue
                values = "".join(f"{_shown(f.value):>10}" for f in (each.before, each.after))
                worse = f"  worse than normal: {each.before.normal}" if each.is_worse else ""
                lines.append(f"{each.before.name:<42}{values}  {each.before.unit}{worse}")
        return "\n".join(lines)


def _shown(value):
    # A rounding error is not a length.
    return "–" if math.isnan(value) else f"{0.0 if abs(value) < _NOTHING else value:.4g}"


def compare(options: Options, out: Path) -> Result:
    """Run the nodes of a recording again, and write page, tables and bag into a folder.

    `InputError`, `BagError`, `ReportError`, `ParameterError`: it cannot be done; the text says why.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=out) as place:
            return _compare(options, out, Path(place))
    except OSError as error:
        raise ReportError(f"the result cannot be written into {out}: {error}") from None


def _compare(options, out, place):
    journals = flight_input.journals_of(options.recording)
    if journals:
        given = flight_input.of_journals(journals)
        _write_bag(out / RECORDED, [(g.time, g.topic, g.message()) for g in given.messages], "")
        # From here on it is as a bag, but for the order and the parameters, which are known.
        options = replace(options, recording=out / RECORDED)
    log = _one_log(options.recording, place / "recorded")
    namespace = _namespace(log, options.vehicle)
    own = [each for each in flights(log) if each.vehicle.namespace == namespace]
    is_driven = any(each.vehicle.is_driven for each in own)
    if not journals:
        launch, *arguments = options.launch or (LAUNCH[is_driven],)
        given = flight_input.of_launch_file(launch, arguments, options.recording, namespace)
    remove_effects(given)
    frame = _find_frame(given, log, namespace)
    interfaces = _interfaces(given, options)
    # What moves the vehicle is in the recording, unless a simulator did in the recorded process.
    if log.frames or not journals:
        interfaces = {name: i for name, i in interfaces.items() if TF not in i.publishes}
    if not journals:
        names = {name for each in interfaces.values() for name in each.topics}
        names |= {_inner(topic, namespace) for topic in log.sources} | {TF}
        flight_input.read_bag(options.recording, namespace, names.__contains__, given)
    _leave_out(given, options)
    _check_topics(given, interfaces, log, frame, options.recording)
    rerun = Rerun(given, interfaces)
    first, last = given.messages[0].time, given.messages[-1].time
    begin = first if options.begin is None else first + options.begin
    end = last if options.end is None else min(last, first + options.end)
    given.calls = given.calls or _calls(given, own)
    if options.is_closed:
        flight = _flown(own, options.recording, begin, end)
        begin = max(first, flight.start - _BEFORE) if options.begin is None else begin
        end = min(end, flight.end + MARGIN)
        _close(rerun, flight, begin, frame, options, out, given)
    if begin >= end:
        raise InputError(f"--from {options.begin} is not before --to {end - first:.1f} s")
    sent = rerun.run(end)
    _check_sent(sent, rerun, interfaces, options)
    _write(out / BAG, given, rerun, sent, (begin, end), namespace, options.is_closed)
    given.remarks += sent.refusals + sorted({f"error: {each}" for each in sent.errors})
    other = _one_log(out / BAG, place / "what_if")
    other.name = "what if"
    other.remarks += [_what(options, interfaces), *given.remarks]
    report = Report()
    for each in (log, other):
        report.add(each)
    pairs = _pairs(own, [each for each in flights(other) if each.vehicle.namespace == namespace])
    if own and not pairs:
        raise InputError(f"the nodes do not fly: {[*sent.refusals, rerun.last_warning()][0]}")
    for topic in sorted(_controls_of(interfaces)):
        add_controls(report.recordings, topic, _rows(given, sent, topic))
    lay_over(report.recordings)
    report.write(out)
    changes = [
        (f"{before.vehicle.name}, flight {before.number}", _changes(before, after))
        for before, after in pairs
    ]
    return Result(report, changes)


def _one_log(path, folder):
    folder.mkdir()
    logs = bag_log.read(path, folder)
    if len(logs) > 1:
        raise InputError(f"{path}: simulated time begins {len(logs)} times; expected one flight")
    return logs[0]


def _namespace(log, vehicle):
    names = vehicle_namespaces(log)
    if vehicle.strip("/") in names:
        return vehicle.strip("/")
    if vehicle or len(names) > 1:
        raise InputError(
            f"--vehicle {vehicle}: expected one of {', '.join(map(repr, names)) or 'none'}"
        )
    return names[0] if names else ""


def _inner(topic, namespace):
    return "/" + topic.strip("/").removeprefix(f"{namespace}/" if namespace else "")


def _find_frame(given: FlightInput, log: bag_log.BagLog, namespace: str) -> str:
    """Return the frame of the vehicle on /tf, which the nodes are told if they have another one."""
    names = [each for each in given.parameters if each.endswith("/frames/robot")]
    wanted = {str(given.parameters[each]).strip("/") for each in names}
    if known := wanted & set(log.frames):
        return known.pop()
    found = frame_of(namespace, True, log.frames) or ""
    if found:
        given.parameters.update(dict.fromkeys(names, found))
        given.remarks.append(f"frame of the vehicle: {found}, the one that moves on /tf")
    return found


def _interfaces(given: FlightInput, options: Options) -> dict[str, Interface]:
    """Return the chosen nodes, with the parameters that are asked for."""
    names = sorted(given.classes)
    if not names:
        why = "\n".join(given.remarks)
        raise InputError(f"{options.recording} has no node that can be run again\n{why}")
    unknown = [part for part in options.nodes if not any(part in each for each in names)]
    if unknown:
        raise InputError(f"--nodes {unknown[0]}: no such node; expected of {', '.join(names)}")
    chosen = [n for n in names if not options.nodes or any(p in n for p in options.nodes)]
    owners: dict[str, str] = {}
    for name, value in options.values.items():
        full = "/" + name.strip("/")
        owner = next((each for each in names if full.startswith(f"{each}/")), None)
        if owner is None:
            raise InputError(f"--set {name}: no such node; expected one of {', '.join(names)}")
        if owner not in chosen:
            raise InputError(
                f"--set {name}: {owner} is not among --nodes {','.join(options.nodes)}"
            )
        owners[full] = owner
        given.parameters[full] = value
    found = {name: interface(name, given) for name in chosen}
    for full, owner in owners.items():
        if full not in found[owner].parameters:
            known = sorted(each.removeprefix(f"{owner}/") for each in found[owner].parameters)
            raise InputError(
                f"--set {full[1:]}: {owner} reads no such parameter; expected one of "
                f"{', '.join(known)}"
            )
    return found


def _leave_out(given, options):
    """Remove names of topics without which a takeoff would be refused, if they are not recorded."""
    recorded = {each.topic for each in given.messages}
    for name, value in list(given.parameters.items()):
        is_optional = name.endswith(("/topics/connected", "/topics/battery"))
        if is_optional and value not in recorded and name[1:] not in options.values:
            del given.parameters[name]
            given.remarks.append(f"{name} is not set, as {value} was not recorded")


def _check_topics(given, interfaces, log, frame, path):
    """Raise `InputError` if a topic is missing without which a node does nothing."""
    recorded = {each.topic for each in given.messages}
    published = {topic for each in interfaces.values() for topic in each.publishes}
    missing = []
    for name, each in interfaces.items():
        for topic, message_type in each.subscribes.items():
            is_needed = topic == TF or hasattr(message_type(), "state") and _is_state(message_type)
            is_there = topic in recorded or topic in published or topic.endswith("_descent")
            if is_needed and not is_there:
                missing.append(f"{topic} ({message_type._type}), which {name} reads")
    is_read = any(TF in each.subscribes for each in interfaces.values())
    if not missing and is_read and TF not in published and frame not in log.frames:
        frames = ", ".join(sorted(log.frames)) or "none"
        missing.append(f"the frame {frame or 'of the vehicle'} on /tf; there are {frames}")
    if missing or not given.messages:
        raise InputError(f"{path} does not have {'; '.join(missing) or 'any message of a node'}")


def _is_state(message_type):
    return message_type._type.startswith("crazyflie_msgs/") and "State" in message_type._type


def _calls(given, own):
    """Return the calls of takeoff and land, which a bag does not have, at the phases' times."""
    found = []
    for flight in own:
        if flight.phases[0].name != "taking off":
            continue
        for event, default in (("takeoff", "/takeoff"), ("land", "/land")):
            time = flight.record.events[event]
            if event == "takeoff" or time < flight.record.events["landed"]:
                service = given.parameters.get(f"/takeoff_server/srv/{event}", default)
                found.append((time, service, EmptyRequest()))
    return found


def _flown(own: list[Flight], path: Path, begin: float, end: float) -> Flight:
    inside = [each for each in own if each.end > begin and each.start < end]
    if not inside:
        raise InputError(f"{path} has no flight there; --closed needs one")
    flight = max(inside, key=lambda each: each.end - each.start)
    if flight.phases[0].name != "taking off":
        raise InputError(f"{path} begins in flight; --closed needs the takeoff, too")
    return flight


def _close(rerun, flight, begin, frame, options, out, given):
    if rerun.command is None:
        raise InputError("--closed needs a node that publishes control/final or cmd_vel")
    model, explained = _model(flight, options, out, given)
    given.remarks.append(
        f"model: {model.name}; it does not explain {explained.rms:.2g} m/s² (rms) of the recorded "
        "acceleration, which acts on it as a wind"
    )
    rerun.fly(FlownModel(model, explained, begin), begin, frame)


def _model(
    flight: Flight, options: Options, out: Path, given: FlightInput
) -> tuple[VehicleModel, Explained]:
    """Return the model that is asked for, or identified, or else explains the recording best."""
    is_driven = flight.vehicle.is_driven
    if options.model:
        candidates = [VehicleModel.of(options.model, is_driven)]
    elif identified := _identify(options, flight.vehicle.name, out / "model.yaml", given):
        candidates = [identified]
    else:
        names = ["cf21", *(() if is_driven else IDEAL)]
        candidates = [VehicleModel.of(name, is_driven) for name in names]
    begin, end = flight.start - MARGIN, flight.end + MARGIN
    found = [(each, explain(each, flight.vehicle, begin, end)) for each in candidates]
    explained = [(model, each) for model, each in found if each is not None]
    if not explained:
        raise InputError(f"{options.recording} has no poses or no controls of the flight")
    return min(explained, key=lambda each: each[1].rms)


def _identify(
    options: Options, vehicle: str, path: Path, given: FlightInput
) -> VehicleModel | None:
    """Return the model that the command identify finds in the recording, if it finds one."""
    texts = io.StringIO()
    try:
        # By name: identify stands on this package.
        identify = load("crazyflie_identification.command:main")
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(texts):
            arguments = [str(options.recording), "--vehicle", vehicle, "--out", str(path)]
            status = identify(arguments)
    except ImportError as error:
        status = 1
        print(f"identify is not installed: {error}", file=texts)
    if status:
        given.remarks.append(f"no model was identified: {texts.getvalue().strip()}")
        return None
    return VehicleModel.of(str(path), True, "the one that identify found in this recording")


def _check_sent(sent, rerun, interfaces, options):
    topics = {topic for _, topic, _ in sent.published}
    for name, each in interfaces.items():
        states = [topic for topic, kind in each.publishes.items() if _is_state(kind)]
        if TF in each.subscribes and states and not topics & set(states):
            raise InputError(f"{name} has published no state: {rerun.last_warning()}")
    if options.is_closed and sent.refusals:
        raise InputError(f"the recorded flight cannot begin: {sent.refusals[0]}")


def _write(path, given, rerun, sent, part, namespace, is_closed):
    """Write the other flight: what was recorded, with what the nodes publish in its place."""
    begin, end = part
    rows = []
    for each in given.messages:
        is_part = begin <= each.time <= end
        if (not is_part and (each.time < begin or not is_closed)) or (
            is_part and not is_closed and not rerun.is_own(each)
        ):
            rows.append((each.time, each.topic, each.message()))
    new = sent.published + (sent.delivered if is_closed else [])
    rows += [row for row in new if begin <= row[0] <= end]
    _write_bag(path, sorted(rows, key=itemgetter(0)), namespace)


def _write_bag(path, rows, namespace):
    with rosbag.Bag(str(path), "w", "lz4") as bag:
        for time, topic, message in rows:
            outer = topic if topic in _SHARED or not namespace else f"/{namespace}{topic}"
            bag.write(outer, message, genpy.Time.from_sec(time))


def _what(options, interfaces):
    values = ", ".join(f"{name} = {value}" for name, value in options.values.items())
    nodes = ", ".join(name.strip("/") for name in interfaces)
    text = f"Today's {nodes} with {values or 'no other parameters'}"
    if options.is_closed:
        return f"{text}, in closed loop with a model of the vehicle"
    if options.recording.name == RECORDED:
        return f"{text}, in open loop, on what was recorded, in the recorded order"
    return (
        f"{text}, in open loop, on what was recorded. An approximation: messages come in the order "
        "in which the bag has them"
    )


def _controls_of(interfaces):
    """Return topics of controls between nodes; those to the vehicle are on the page anyway."""
    kind = "crazyflie_msgs/ControlStamped"
    return {
        topic
        for each in interfaces.values()
        for topic, message_type in each.publishes.items()
        if message_type._type == kind and role_of(topic, kind, {}) is None
    }


def _rows(given, sent, topic):
    """Return controls of a topic, then and now: time (s) and fields."""
    both = (
        [(each.time, each.message()) for each in given.messages if each.topic == topic],
        [(time, message) for time, name, message in sent.published if name == topic],
    )
    before, after = (
        np.array([(time, *to_tuple(m.control)) for time, m in rows]).reshape(-1, 5) for rows in both
    )
    return before, after


def _pairs(before: list[Flight], after: list[Flight]) -> list[tuple[Flight, Flight]]:
    """Return the flights of two recordings at the same times."""
    found = []
    for each in before:
        common = {k: min(each.end, o.end) - max(each.start, o.start) for k, o in enumerate(after)}
        best = max(common, key=lambda k: common[k], default=None)
        if best is not None and common[best] > 0.0:
            found.append((each, after[best]))
    return found


def _changes(before: Flight, after: Flight) -> list[Change]:
    both = zip(figures_of_motion(before), figures_of_motion(after), strict=True)
    # The limits of the recorded flight hold: without a driver's topics others would.
    return [Change(f, replace(f, value=other.value)) for f, other in both]


def main(arguments: list[str] | None = None) -> int:
    """Compare by the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="what_if", description=__doc__)
    parser.add_argument(
        "recording",
        type=Path,
        metavar="RECORDING",
        help="bag of ROS 1, folder of a recording, journal, or folder of journals",
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="NODE/PARAM=VALUE", help="another parameter"
    )
    parser.add_argument(
        "--nodes", default="", help="parts of the names of nodes, such as estimator,lqr (all)"
    )
    parser.add_argument("--from", type=float, dest="begin", metavar="S", help="begin, s (takeoff)")
    parser.add_argument("--to", type=float, dest="end", metavar="S", help="end, s (all)")
    parser.add_argument("--closed", action="store_true", help="a model flies by the controls")
    parser.add_argument(
        "--type", default="", metavar="MODEL",
        help=f"type of vehicle, model file, {' or '.join(IDEAL)} (that of identify, or the best)",
    )  # fmt: skip
    parser.add_argument("--vehicle", default="", help="namespace of the vehicle, if there are more")
    parser.add_argument(
        "--launch",
        nargs="+",
        default=[],
        metavar=("FILE", "ARGUMENT"),
        help="launch file of the nodes, NAME:=VALUE (crazyflie_examples/sw_hover.launch, hw_hover)",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/what_if"), help="folder of the result (%(default)s)"
    )
    options = parser.parse_args(arguments)
    values = {}
    for each in options.set:
        name, sign, value = each.partition("=")
        if not sign or "/" not in name.strip("/"):
            parser.error(f"--set {each}: expected NODE/PARAM=VALUE")
        try:
            values[name] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            parser.error(f"--set {each}: {error}")
    nodes = tuple(filter(None, options.nodes.split(",")))
    asked = Options(
        options.recording, values, nodes, options.closed, options.begin, options.end,
        tuple(options.launch), options.type, options.vehicle,
    )  # fmt: skip
    try:
        result = compare(asked, options.out)
    except (InputError, BagError, JournalError, ReportError, ParameterError) as error:
        print(f"what_if: {error}", file=sys.stderr)
        return FAILED
    print(result.table())
    print(*result.report.recordings[1]["remarks"], sep="\n")
    print(f"page: {options.out / PAGE}", f"bag: {options.out / BAG}", sep="\n")
    return WORSE if result.is_worse else 0
