"""The command `doctor`: prints a line for each finding."""

import os
import sys
import threading
from collections.abc import Iterator, Mapping

import rosgraph

from crazyflie_doctor import computer, graph, installation, running_graph, timing, vehicle
from crazyflie_doctor.finding import ERROR, WARN, Check, Finding, lines, warn
from crazyflie_doctor.running_graph import record
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.command_line import parse_arguments
from crazyflie_utils.parameters.types import BOOLEAN, Number, Text

_SECONDS = Number(unit="s", above=0.0)


class DoctorParameters(Parameters):
    """Options of the command line."""

    duration: float = parameter(_SECONDS, "how long to record tf, controls and diagnostics", 3.0)
    vehicle: str = parameter(
        Text(may_be_empty=True),
        "address of a vehicle on the ground: only this vehicle is checked, for 10 s",
        "",
    )
    motors: bool = parameter(
        BOOLEAN, "also the vehicle's self tests of motors and battery: the propellers turn", False
    )
    timeout: float = parameter(_SECONDS, "when to give up", 40.0)


def doctor(arguments: list[str] | None = None) -> int:
    """Check the installation and the running graph; return 1 if there are errors, otherwise 0."""
    given = sys.argv[1:] if arguments is None else arguments
    options = parse_arguments(
        DoctorParameters,
        [each for each in given if ":=" not in each],
        "doctor",
        "Check this computer and the running graph; print a line for each finding and what to do "
        "about it. The command publishes nothing, and connects only to a vehicle that is given. "
        "Exit status: 0 without errors, 1 with errors, 2 wrong usage.",
    )
    watchdog = threading.Timer(options.timeout, _give_up, [options.timeout])
    watchdog.daemon = True
    watchdog.start()
    count = {WARN: 0, ERROR: 0}
    if options.vehicle:
        examined = vehicle.checks(vehicle.examine(options.vehicle, motors=options.motors))
    else:
        examined = _checks(options.duration)
    for check in examined:
        for level, line in lines(check):
            print(line, flush=True)
            count[level] = count.get(level, 0) + 1
    words = ((count[ERROR], "error"), (count[WARN], "warning"))
    print(", ".join(f"{n} {word}{'' if n == 1 else 's'}" for n, word in words), flush=True)
    watchdog.cancel()
    return 1 if count[ERROR] else 0


def _give_up(limit):
    print(f"error  doctor: not done within {limit:g} s; is something overloaded or frozen?")
    sys.stdout.flush()
    # Any thread may be blocked.
    os._exit(1)


def _checks(duration: float) -> Iterator[Check]:
    yield from _of_the_computer()
    if not running_graph.is_master_online():
        missing = warn(
            f"no ROS master at {rosgraph.get_master_uri()}, the graph was not checked",
            "start one with roslaunch or roscore, or correct ROS_MASTER_URI",
        )
        yield Check("master", "", [missing])
        yield _radio([])
        return
    running = running_graph.graph()
    if not set(running.publishers.get("/rosout", ())) - {"/rosout"}:
        yield Check(
            "master", "", [warn("no node is running", "roslaunch the nodes that are to be checked")]
        )
    yield Check("nodes", "all answer", graph.check_nodes(running))
    yield Check("types", "all are ours", graph.check_types(running, running_graph.own_md5))
    yield Check("connections", "complete", _connections(running))
    yield Check("publishers", "one of each", graph.check_publishers(running))
    recording = record(running, duration)
    yield Check("clock", "one for all", timing.check_clock(running, recording))
    yield Check("tf tree", "is a tree", timing.check_tf_tree(running, recording))
    yield Check("frames", "all are published", timing.check_frames(running, recording))
    yield Check("tf rate", "poses come often and fresh", timing.check_tf_rate(running, recording))
    yield Check("gains", "fit the delay", timing.check_gains(running, recording))
    yield Check("drivers", "one for a vehicle", graph.check_drivers(running, recording.reported))
    yield Check("estimators", "use the poses that come", graph.check_estimators(running))
    yield _radio([*running.uris, *recording.reported])


def _of_the_computer() -> Iterator[Check]:
    first = computer.first_python()
    found = installation.check_python(first, computer.python_of_ros())
    yield Check("Python", f"{first.path}, {first.version}", found)
    yield from _debian_packages()
    pypi = computer.package_sections("requirements.txt").get("", [])
    yield _packages("PyPI", *computer.python_packages(pypi))
    yield Check("network", "can be reached", installation.check_network(computer.network()))
    path, is_writable, free = computer.log_directory()
    found = installation.check_log_directory(path, is_writable, free)
    yield Check("logs", f"{path}, {free / 1e9:.0f} GB free", found)


def _debian_packages():
    sections = computer.package_sections("debian.txt")
    installed = computer.debian_packages()
    yield _packages("Debian", dict.fromkeys(sections.pop("demo", []), ""), installed)
    # ./run installs these sections when they are first needed.
    absent = [name for name, packages in sections.items() if not installed.keys() >= set(packages)]
    if absent:
        fine = f"not installed: {', '.join(absent)}; ./run install {' '.join(absent)}"
        yield Check("sections of debian.txt", fine, [])


def _packages(origin: str, required: Mapping[str, str], installed: Mapping[str, str]) -> Check:
    fine = f"all {len(required)} are installed" if required else "no list here (an install space)"
    found = installation.check_packages(required, installed, "./run install")
    return Check(f"{origin} packages", fine, found)


def _radio(uris: list[str]) -> Check:
    found = computer.radio()
    fine = f"{len(found.dongles)} that may be used" if found.dongles else "none, and none needed"
    return Check("Crazyradio", fine, installation.check_radio(found, uris))


def _connections(running: graph.Graph) -> Iterator[Finding]:
    # A subscriber may just have been connecting: only a connection that is missing twice is
    # reported.
    if list(graph.check_connections(running)):
        yield from graph.check_connections(running_graph.graph())
