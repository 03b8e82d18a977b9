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
from crazyflie_sweep.sweep_parameters import Plan
from crazyflie_sweep.sweeper import Sweeper
from crazyflie_sweep.velocities import oscillator_velocity

COURSE = Path(__file__).resolve().parent


def draw_main_loop(path: Path, _log: Path) -> None:
    """Draw the nodes and topics of the software example through which the state goes round."""
    published, subscribed = (
        [(topic, sorted(MAIN_LOOP & set(nodes))) for topic, nodes in part if topic in LOOP_TOPICS]
        for part in example_graph()
    )
    graph = dot(published, subscribed).replace("rankdir=LR", "rankdir=LR; nodesep=0.1")
    subprocess.run(
        ["dot", "-Tpng", "-Gdpi=80", "-o", str(path)], input=graph, text=True, check=True
    )


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
    from my_sweep.lanes import corners
    from my_sweep.oscillator import velocity
    from my_sweep.sweep_node import AREA, WIDTH

    figure = Figure(figsize=(8, 3.4), layout="constrained")
    plan, graph = figure.subplots(1, 2)
    lanes = np.array([(0.0, 0.0), *corners(AREA, WIDTH)])
    plan.add_patch(Rectangle((-1.5, -1.5), 3.0, 3.0, color="0.93"))
    arrow = {"arrowstyle": "-|>", "color": "C0"}
    for p, q in zip(lanes, lanes[1:], strict=False):
        plan.plot(*zip(p, q, strict=True), color="C0")
        plan.annotate("", (0.4 * p + 0.6 * q), (0.6 * p + 0.4 * q), arrowprops=arrow)
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
    plan = Plan.from_mapping({})
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
