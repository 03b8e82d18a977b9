"""Pictures of the lessons that need no flight."""

import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from crazyflie_mission_api import DryRun
from crazyflie_mission_api.group_state import Rules
from crazyflie_reports.node_graph import dot, example_graph
from crazyflie_sweep.sweep_parameters import SweepPlan
from crazyflie_sweep.sweeper import Sweeper
from crazyflie_sweep.velocities import oscillator_velocity

COURSE = Path(__file__).resolve().parent


def draw_main_loop(path: Path, _log: Path) -> None:
    """Draw the nodes and topics of the software example through which the state goes round."""
    published, subscribed = (
        [(topic, sorted(MAIN_LOOP & set(nodes))) for topic, nodes in part if topic in LOOP_TOPICS]
        for part in example_graph()
    )
    _draw_graph(dot(published, subscribed).replace("rankdir=LR", "rankdir=LR; nodesep=0.1"), path)


def _draw_graph(graph: str, path: Path) -> None:
    subprocess.run(
        ["dot", "-Tpng", "-Gdpi=80", "-o", str(path)], input=graph, text=True, check=True
    )


def draw_graph(path: Path, _log: Path) -> None:
    """Draw one of the graphs below, by the name of the picture."""
    _draw_graph(f"digraph {{ {_STYLE} {GRAPHS[path.stem]} }}", path)


_STYLE = """
  rankdir=LR; bgcolor=white; nodesep=0.15; ranksep=0.35; fontname=Helvetica; fontsize=12;
  node [fontname=Helvetica, fontsize=11, shape=box, height=0.3];
  edge [fontname=Helvetica, fontsize=10];
"""

GRAPHS = {
    "workspace": """
      subgraph cluster_ours { label="this repository"; style=rounded; margin=12;
        packages [label="ros/src: packages"]; ours [label="ros/devel", style=dashed];
        packages -> ours [label="./run build"];
      }
      subgraph cluster_yours { label="~/my_workspace (yours)"; style=rounded; margin=12;
        subgraph cluster_package { label="src/spike_filter (a package)"; color=steelblue;
          about [shape=plain, label="package.xml: needed packages\\lCMakeLists.txt: the build\\l"];
          code [shape=plain, label="median.py: the algorithm\\lmedian_node.py: the node\\l"];
          tests [shape=plain, label="test/: tests of both\\l"];
        }
        devel [label="devel", style=dashed];
      }
      code -> devel [label="catkin_make"];
      ours -> devel [label="is below", style=dashed, constraint=false];
    """,
    "formation": """
      circle [shape=ellipse, label="/leader/circle"];
      topic [label="/leader/cmd_vel"];
      circle -> topic;
      subgraph cluster_left { label="group ns=left"; style=rounded;
        left [shape=ellipse, label="/left/composed"];
        left_name [label="/left/cmd_vel", style=dotted, fontcolor=gray50];
      }
      subgraph cluster_right { label="group ns=right"; style=rounded;
        right [shape=ellipse, label="/right/composed"];
        right_name [label="/right/cmd_vel", style=dotted, fontcolor=gray50];
      }
      topic -> left [label="remapped"]; topic -> right [label="remapped"];
      left_name -> left [style=dotted, color=gray50, label="without remap"];
      right_name -> right [style=dotted, color=gray50, label="without remap"];
    """,
    "service": """
      ranksep=1.6;
      client [shape=ellipse, label="client\\nServiceProxy"];
      server [shape=ellipse, label="server\\nadvertise_service"];
      client -> server [label="request: float32 x"];
      server -> client [label="response: float32 vel, or an error"];
    """,
    "virtual": """
      subgraph cluster_same { label="the same nodes everywhere"; style=rounded;
        flight [shape=ellipse, label="estimator, controller,\\ntakeoff server, filter"];
      }
      subgraph cluster_simulated { label="simulated: sw_hover.launch"; style=rounded;
        color=seagreen;
        simulator [shape=ellipse, label="/simulator"]; }
      driver [shape=ellipse, label="/cmd_vel_converter,\\n/crazyflie_server,\\n/mocap_node"];
      subgraph cluster_virtual { label="virtual: virtual_hw_hover.launch"; style=rounded;
        color=darkorange; vehicle [label="/virtual_crazyflie,\\n/virtual_mocap"]; }
      subgraph cluster_real { label="real: hw_hover.launch"; style=rounded; color=firebrick;
        real [label="Crazyflie, cameras"]; }
      flight -> simulator [dir=both, label="controls, /tf"];
      flight -> driver [dir=both, label="controls, /tf"];
      driver -> vehicle [dir=both, label="radio protocol, poses"];
      driver -> real [dir=both, label="radio, poses"];
    """,
}
"""Pictures of lessons 2, 4, 5 and 14, in the language of graphviz."""

MAIN_LOOP = {"/simulator", "/state_estimator", "/lqr_controller", "/takeoff_control_filter"}
LOOP_TOPICS = {"/tf", "/state", "/control/lqr", "/control/final"}


def draw_four_vehicles(path: Path, _log: Path) -> None:
    """Draw where the mission of lesson 12 sends its vehicles, by a dry run."""
    sys.path.insert(0, str(COURSE / "solutions" / "12" / "four_vehicles" / "src"))
    from four_vehicles.mission import LIMITS, ROOM, mission

    class Recorder(DryRun):
        def go_to(self, goals, *arguments, **options):
            for name, goal in goals.items():
                ways[name].append(goal)
            super().go_to(goals, *arguments, **options)

    starts = {f"cf{k + 1}": (k // 2 - 0.5, k % 2 - 0.5, 0.0) for k in range(4)}
    ways = {name: [start] for name, start in starts.items()}
    with Recorder(starts, Rules(bounds=ROOM, limits=LIMITS)) as fleet:
        mission(fleet)
    figure = Figure(figsize=(4.4, 4.2), layout="constrained")
    axes = figure.subplots()
    for k, (name, way) in enumerate(ways.items()):
        points = np.array(way)[:, :2] * (1.0 - 0.06 * k)  # beside each other, to be told apart
        axes.plot(*points.T, color=f"C{k}", alpha=0.5)
        axes.plot(*points[0], "o", color=f"C{k}", label=f"{name}, where it takes off")
        for p, q in zip(points, points[1:3], strict=False):
            arrow = {"arrowstyle": "-|>", "color": f"C{k}"}
            axes.annotate("", 0.4 * p + 0.6 * q, 0.6 * p + 0.4 * q, arrowprops=arrow)
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(-0.9, 0.9), ylim=(-0.9, 0.9))
    axes.grid(alpha=0.3)
    axes.legend(loc="center", fontsize="small")
    figure.savefig(path, dpi=90)


def draw_lanes(path: Path, _log: Path) -> None:
    """Draw the lanes of lesson 6, and the oscillator's velocity along one of them."""
    sys.path.insert(0, str(COURSE / "solutions" / "6" / "my_sweep" / "src"))
    from my_sweep.oscillator import velocity
    from my_sweep.sweep_node import HEIGHT, path_from

    figure = Figure(figsize=(8, 3.4), layout="constrained")
    plan, graph = figure.subplots(1, 2)
    whole = path_from((0.0, 0.0, HEIGHT))
    lanes = np.array([whole.at(s)[0][:2] for s in np.linspace(0.0, whole.length, 600)])
    plan.add_patch(Rectangle((-1.5, -1.5), 3.0, 3.0, color="0.93"))
    arrow = {"arrowstyle": "-|>", "color": "C0"}
    plan.plot(*lanes.T, color="C0")
    for k in range(60, 600, 60):
        plan.annotate("", lanes[k + 4], lanes[k], arrowprops=arrow)
    plan.plot(0.0, 0.0, "o", color="C2")
    plan.annotate("take off", (0.0, 0.0), (6, 6), textcoords="offset points")
    plan.plot(*lanes[-1], "s", color="C3")
    plan.annotate("land", lanes[-1], (-30, 8), textcoords="offset points")
    plan.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="the path, seen from above")
    x = np.linspace(2.0, 9.0, 100)
    graph.plot(x, [velocity(value) for value in x])
    graph.set(xlabel="x of the service", ylabel="vel", title="what the service answers")
    graph.grid(alpha=0.3)
    figure.savefig(path, dpi=90)


def draw_sweep(path: Path, _log: Path) -> None:
    """Draw a sweep that is half done: where it flew, and what that has covered."""
    plan = SweepPlan.from_mapping({})
    sweeper = Sweeper(plan, (0.0, 0.0, 1.0))
    flown = []
    while sweeper.coverage.share < 0.5:
        position = sweeper.reference[:3]
        flown.append(position)
        sweeper.measure(position)
        sweeper.advance(0.05, oscillator_velocity(sweeper.service_position(position[0])))
    way = np.array(flown)
    lanes = np.array([sweeper.lanes.at(s)[0] for s in np.linspace(0, sweeper.lanes.length, 500)])
    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    axes = figure.subplots()
    for covered, colour, label in ((False, "0.88", "not covered"), (True, "#a5d8b4", "covered")):
        x, y = sweeper.coverage.middles(covered).T
        axes.scatter(x, y, marker="s", s=62, color=colour, label=label)
    axes.plot(lanes[:, 0], lanes[:, 1], "--", color="C1", lw=1, label="lanes")
    axes.plot(way[:, 0], way[:, 1], color="C0", lw=2, label="flown")
    axes.plot(way[-1, 0], way[-1, 1], "o", color="C0")
    notes = {0: "takes off, and flies\nto the first lane:\nthat covers a wedge", -1: "now"}
    for k, text in notes.items():
        axes.annotate(text, way[k, :2], (8, 8), textcoords="offset points")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    axes.set_title(f"{sweeper.coverage.share:.0%} is covered")
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))
    figure.savefig(path, dpi=90, bbox_inches="tight")
