"""Draws the pictures of the lessons from flights.

python3 docs/course/draw_pictures.py [NAME ...]

It needs a workspace that is built and sourced, and packages of docs/course/solutions built in
~/my_workspace.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rosgraph
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

from crazyflie_dev.render_rviz import background_of, crop_to_scene
from crazyflie_dev.virtual_display import screenshot, virtual_display
from crazyflie_mission_api import DryRun
from crazyflie_mission_api.group_state import Rules
from crazyflie_reports.flight_operator import FlightOperator
from crazyflie_reports.flight_record import FlightRecord
from crazyflie_reports.node_graph import dot, example_graph
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import roslaunch
from crazyflie_utils.testing.programs import running

COURSE = Path(__file__).resolve().parent
QUICK = "sim_time:=true real_time_factor:=2 composed:=true simulator_dt:=0.01".split()
SCREEN = (1400, 900)
COLOURS = 64
LIMIT = 300.0
"""The longest that a part of a flight may take, s: RViz draws without a graphics card."""


def operate() -> FlightOperator:
    """Return an operator of what was launched, as soon as it can take off."""
    # Before, nobody has told yet whether time is simulated.
    wait_for_service("/takeoff")
    operator = FlightOperator(begin("draw_pictures"), limit=LIMIT)
    operator.wait_until_ready()
    return operator


def wait_for_service(name: str, limit: float = 60.0) -> None:
    """Wait until a service is offered, s at most."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        services = rosgraph.Master("/draw_pictures_wait").getSystemState()[2]
        if name in [service for service, _ in services]:
            return
        time.sleep(0.5)
    raise TimeoutError(f"there is no {name} after {limit:g} s")


def draw_figure_eight(path: Path, log: Path) -> None:
    """Draw the way of a figure of eight, seen from above."""
    arguments = ["figure_eight", "figure_eight.launch", "rviz:=false", "takeoff:=false", *QUICK]
    with roslaunch(arguments, log):
        operator = operate()
        operator.takeoff()
        operator.hover(21.5)
        operator.land()
        record = operator.finish()
    times = record.state.times
    flying = (times >= record.events["flying"]) & (times <= record.events["land"])
    x, y = record.state.column("x")[flying], record.state.column("y")[flying]
    figure = Figure(figsize=(5, 3), layout="constrained")
    axes = figure.subplots()
    axes.plot(y, x)
    axes.plot(y[0], x[0], "o")
    axes.invert_xaxis()
    axes.set(xlabel="y (m)", ylabel="x (m)", aspect="equal")
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=90)


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


def step(gains: Path, log: Path) -> FlightRecord:
    """Fly a step of half a metre along x with a gain file; return the record."""
    arguments = ["dynamics:=quadrotor", "integrator_k_x:=0", "integrator_k_y:=0", "rviz:=false"]
    with roslaunch(
        ["crazyflie_examples", "sw_hover.launch", f"K_file:={gains}", *arguments, *QUICK], log
    ):
        operator = operate()
        operator.takeoff()
        operator.hover(4.0)
        operator.refer_to((0.5, 0.0, 1.0))
        operator.hover(5.0)
        operator.land()
        return operator.finish()


def draw_steps(path: Path, log: Path) -> None:
    """Draw the position after a step, in a process for each gain file."""
    figure = Figure(figsize=(6, 4), layout="constrained")
    position, tilt = figure.subplots(2, 1, sharex=True)
    for name in ("K_quadrotor.txt", "K_calm.txt"):
        data = log.with_name(f"{name}.npz")
        if os.fork() == 0:
            folder = COURSE / "solutions" if name == "K_calm.txt" else gains_folder()
            record = step(folder / name, log)
            end = record.events["land"]
            start = record.reference.times[record.reference.column("x") == 0.5][0]
            after, sent = (
                (times >= start) & (times <= end)
                for times in (record.state.times, record.final_control.times)
            )
            np.savez(
                data,
                t=record.state.times[after] - start,
                x=record.state.column("x")[after],
                tc=record.final_control.times[sent] - start,
                pitch=record.final_control.column("pitch")[sent],
            )
            os._exit(0)
        os.wait()
        saved = np.load(data)
        position.plot(saved["t"], saved["x"], label=name)
        tilt.plot(saved["tc"], np.degrees(saved["pitch"]))
    position.axhline(0.5, color="gray", linestyle="--")
    position.set_ylabel("x (m)")
    position.legend(loc="lower right")
    tilt.set(xlabel="time after the step (s)", ylabel="pitch (degrees)", xlim=(0.0, 5.0))
    for axes in (position, tilt):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=90)


def gains_folder() -> Path:
    """Return the folder of the workspace's gain files."""
    return COURSE.parents[1] / "ros" / "src" / "crazyflie_lqr" / "config"


def draw_scene(path: Path, log: Path, arguments: list[str], config: Path, fly: Callable) -> None:
    """Draw what RViz shows after ``fly`` has done what it does."""
    with virtual_display(*SCREEN) as display:
        os.environ.update(DISPLAY=display, LIBGL_ALWAYS_SOFTWARE="1")
        with roslaunch([*arguments, f"config:={config}", "rviz:=true", *QUICK], log):
            operator = fly()
            scene = crop_to_scene(screenshot(display), background_of(config))
            operator.land()
    image = Image.fromarray(scene)
    image.thumbnail((900, 700))
    image.quantize(COLOURS).save(path, optimize=True)


def draw_sweep(path: Path, log: Path) -> None:
    """Draw a sweep when about half of the area is covered."""
    package = COURSE.parents[1] / "ros/src/crazyflie_tutorials/crazyflie_sweep"

    def fly():
        operator = operate()
        operator.hover(35.0)
        time.sleep(3.0)
        return operator

    arguments = ["crazyflie_sweep", "sweep.launch"]
    draw_scene(path, log, arguments, package / "launch" / "sweep.rviz", fly)


def draw_pole(path: Path, log: Path) -> None:
    """Draw the circle around the pole."""

    def fly():
        operator = operate()
        with running("rosrun", "pole", "pole_node"):
            operator.hover(25.0)
            time.sleep(5.0)
            return operator

    arguments = ["crazyflie_teleop", "circle.launch"]
    draw_scene(path, log, arguments, COURSE / "launch" / "pole.rviz", fly)


PICTURES = {
    "figure_eight": draw_figure_eight,
    "four_vehicles": draw_four_vehicles,
    "lanes": draw_lanes,
    "main_loop": draw_main_loop,
    "sweep": draw_sweep,
    "pole": draw_pole,
    "steps": draw_steps,
}


def main() -> int:
    """Draw the pictures that are named, each in a process of its own; return the status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PICTURES))
    status = 0
    for name in parser.parse_args().names or PICTURES:
        if os.fork() == 0:
            with tempfile.TemporaryDirectory() as folder:
                picture = COURSE / "images" / f"{name}.png"
                PICTURES[name](picture, Path(folder) / "roslaunch.log")
                print(f"{picture}: {picture.stat().st_size / 1000:.0f} kB", flush=True)
            os._exit(0)
        status |= os.wait()[1]
    return int(status != 0)


if __name__ == "__main__":
    sys.exit(main())
