"""The program: looks, listens, prints a line for each finding."""

import argparse
import os
import sys
import threading
from collections.abc import Iterator
from functools import partial

import rosgraph

from crazyflie_tools.doctor import graph, installation, listen, look, motion
from crazyflie_tools.doctor.finding import ERROR, WARN, Check, Finding, lines, warn
from crazyflie_tools.program import FAILED, FINE, add_timeout, make_parser, seconds


def doctor(arguments: list[str] | None = None) -> int:
    """Check the installation and the running graph; return the exit status."""
    parser = make_parser(
        "doctor",
        "Check this computer and the graph that runs, print a line for each finding and say what "
        "to do about it. Vehicles are not spoken to, and nothing is published.",
    )
    parser.add_argument(
        "--duration",
        type=seconds,
        default=3.0,
        metavar="SECONDS",
        help="how long to listen to tf, controls and diagnostics; by default %(default)g",
    )
    add_timeout(parser)
    options = parser.parse_args(_without_remappings(arguments))
    watchdog = threading.Timer(options.timeout, _give_up, [options.timeout])
    watchdog.daemon = True
    watchdog.start()
    count = {WARN: 0, ERROR: 0}
    for check in _checks(options):
        for level, line in lines(check):
            print(line, flush=True)
            count[level] = count.get(level, 0) + 1
    print(f"{count[ERROR]} errors, {count[WARN]} warnings", flush=True)
    watchdog.cancel()
    return FAILED if count[ERROR] else FINE


def _without_remappings(arguments):
    return [a for a in (sys.argv[1:] if arguments is None else arguments) if ":=" not in a]


def _give_up(limit):
    print(f"error  doctor: not done within {limit:g} s; is something overloaded or frozen?")
    sys.stdout.flush()
    # Whatever hangs, and in whatever thread.
    os._exit(FAILED)


def _checks(options: argparse.Namespace) -> Iterator[Check]:
    yield from _of_the_computer()
    if not look.is_master_online():
        yield Check("master", "", partial(_no_master, rosgraph.get_master_uri()))
        yield _radio([])
        return
    running = look.graph()
    if not set(running.publishers.get("/rosout", ())) - {"/rosout"}:
        yield Check("master", "", lambda: [warn("no node runs", "roslaunch what is to be checked")])
    yield Check("nodes", "all answer", lambda: graph.check_nodes(running))
    yield Check("types", "all are ours", lambda: graph.check_types(running, look.own_md5))
    yield Check("connections", "complete", partial(_connections, running))
    yield Check("publishers", "one of each", lambda: graph.check_publishers(running))
    heard = listen.listen(running, options.duration)
    for name, fine, find in (
        ("clock", "one for all", motion.check_clock),
        ("tf tree", "is a tree", motion.check_tf_tree),
        ("frames", "all are published", motion.check_frames),
        ("tf rate", "poses come often and fresh", motion.check_tf_rate),
        ("gains", "fit the delay", motion.check_gains),
    ):
        # Each check is made before the next is yielded.
        yield Check(name, fine, partial(find, running, heard))
    yield Check(
        "drivers", "one for a vehicle", lambda: graph.check_drivers(running, heard.reported)
    )
    yield _radio([*running.uris, *heard.reported])


def _of_the_computer() -> Iterator[Check]:
    first, of_ros = look.first_python(), look.python_of_ros()
    yield Check(
        "Python",
        f"{first.path}, {first.version}",
        lambda: installation.check_python(first, of_ros),
    )
    debian = dict.fromkeys(look.package_list("debian.txt"), "")
    yield Check(
        "Debian packages",
        f"all {len(debian)} are installed" if debian else "no list here (an install space)",
        lambda: installation.check_packages(debian, look.debian_packages(), "./run install"),
    )
    wanted, installed = look.python_packages(look.package_list("requirements.txt"))
    yield Check(
        "PyPI packages",
        f"all {len(wanted)} are installed" if wanted else "no list here (an install space)",
        lambda: installation.check_packages(wanted, installed, "./run install"),
    )
    yield Check("network", "can be reached", lambda: installation.check_network(look.network()))
    path, is_writable, free = look.log_directory()
    yield Check(
        "logs",
        f"{path}, {free / 1e9:.0f} GB free",
        lambda: installation.check_log_directory(path, is_writable, free),
    )


def _no_master(uri: str) -> list[Finding]:
    return [
        warn(
            f"no ROS master at {uri}, the graph was not checked",
            "start one with roslaunch or roscore, or mend ROS_MASTER_URI",
        )
    ]


def _radio(uris: list[str]) -> Check:
    found = look.radio()
    fine = f"{len(found.dongles)} that may be used" if found.dongles else "none, and none needed"
    return Check("Crazyradio", fine, lambda: installation.check_radio(found, uris))


def _connections(running: graph.Graph) -> list[Finding]:
    findings = list(graph.check_connections(running))
    # Somebody may just have begun to listen.
    return list(graph.check_connections(look.graph())) if findings else findings
