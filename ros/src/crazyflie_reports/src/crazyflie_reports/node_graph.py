"""Draws the nodes and topics of the software example, or of the running graph.

Nodes are ovals, topics boxes; an arrow is a registration of a publisher or subscriber with the
master.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rosgraph

from crazyflie_utils.testing.launching import roslaunch

#: Topics, each with its nodes, as `rosgraph.Master.getSystemState` gives them.
Registrations = list[tuple[str, list[str]]]

HIDDEN_TOPICS = ("/rosout", "/rosout_agg", "/clock", "/tf_static")
HIDDEN_NODES = {"/rosout"}
#: Nodes that fly the vehicle of the software example, and all of it.
FLYING = {
    "/simulator",
    "/state_estimator",
    "/lqr_controller",
    "/takeoff_server",
    "/takeoff_control_filter",
}
EXAMPLE = {*FLYING, "/robot_base_link_publisher"}

_LIMIT = 60.0

#: Time without changes after which a graph is complete (s): nodes register their topics one by one.
_QUIET = 2.0


def dot(published: Registrations, subscribed: Registrations) -> str:
    """Return a graph in the language of graphviz, of topics with a publisher and a subscriber."""
    sources, sinks = (
        {topic: set(nodes) - HIDDEN_NODES for topic, nodes in part if topic not in HIDDEN_TOPICS}
        for part in (published, subscribed)
    )
    lines = ["digraph {", '  rankdir=LR; bgcolor=white; node [fontname="Helvetica", fontsize=11];']
    nodes: set[str] = set()
    edges = []
    for topic in sorted(sources.keys() & sinks.keys()):
        lines.append(f'  "topic {topic}" [label="{topic}", shape=box];')
        edges += [f'  "{node}" -> "topic {topic}";' for node in sorted(sources[topic])]
        edges += [f'  "topic {topic}" -> "{node}";' for node in sorted(sinks[topic])]
        nodes |= sources[topic] | sinks[topic]
    lines += [f'  "{node}" [shape=ellipse];' for node in sorted(nodes)]
    return "\n".join([*lines, *edges, "}"]) + "\n"


def running_graph(expected: set[str]) -> tuple[Registrations, Registrations]:
    """Return publications and subscriptions once all ``expected`` nodes have registered theirs.

    TimeoutError: registrations are missing after some time.
    """
    master = rosgraph.Master("/node_graph")
    deadline = time.monotonic() + _LIMIT
    graph: tuple[Registrations, Registrations] = ([], [])
    since = time.monotonic()
    while time.monotonic() < deadline:
        if rosgraph.is_master_online():
            published, subscribed, _ = master.getSystemState()
            if (published, subscribed) != graph:
                graph, since = (published, subscribed), time.monotonic()
            present = {node for _, nodes in published + subscribed for node in nodes}
            if expected <= present and time.monotonic() - since > _QUIET:
                return graph
        time.sleep(0.2)
    raise TimeoutError(f"not all of {sorted(expected)} were running after {_LIMIT:g} s")


def example_graph() -> tuple[Registrations, Registrations]:
    """Launch the software example, and return its publications and subscriptions.

    TimeoutError: nodes are missing after some time.
    """
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "sw_hover.log"
        print("launching sw_hover", flush=True)
        with roslaunch(["crazyflie_examples", "sw_hover.launch", "rviz:=false"], log):
            try:
                return running_graph(EXAMPLE)
            except TimeoutError as error:
                raise TimeoutError(f"{error}\n{log.read_text()}") from None


def main() -> int:
    """Draw the example, or the running graph; return the exit status."""
    parser = argparse.ArgumentParser(prog="run graph", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/images/sw_hover_graph.svg"))
    parser.add_argument(
        "--running", action="store_true", help="draw the running graph; nothing is launched"
    )
    arguments = parser.parse_args()
    path = arguments.out.resolve()
    if arguments.running and not rosgraph.is_master_online():
        print(f"no ROS master at {rosgraph.get_master_uri()}: no graph is running", file=sys.stderr)
        return 1
    try:
        graph = dot(*(running_graph(set()) if arguments.running else example_graph()))
    except TimeoutError as error:
        print(error, file=sys.stderr)
        return 1
    path.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run(["dot", "-Tsvg", "-o", str(path)], input=graph, text=True, check=True)
    print(f"graph: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
