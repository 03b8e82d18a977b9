"""Draws the pictures of the lessons from flights.

python3 docs/course/draw_pictures.py [NAME ...]

It needs a workspace that is built and sourced, and packages of docs/course/solutions built in
~/my_workspace.
"""

import argparse
import contextlib
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from plots import (
    GRAPHS,
    draw_four_vehicles,
    draw_graph,
    draw_lanes,
    draw_main_loop,
    draw_sweep,
)

from crazyflie_dev.bench_flights import call, wait_for_service
from crazyflie_dev.render_rviz import background_of, crop_to_scene, screenshot, virtual_display
from crazyflie_reports.flight_operator import FlightOperator
from crazyflie_reports.flight_record import FlightRecord
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import roslaunch
from crazyflie_utils.testing.programs import running

COURSE = Path(__file__).resolve().parent
QUICK = "sim_time:=true real_time_factor:=2 composed:=true simulator_dt:=0.01".split()
SCREEN = (1400, 900)
COLOURS = 64
POLE_VIEW = COURSE / "launch" / "pole.rviz"
LIMIT = 300.0
"""The longest that a part of a flight may take, s: RViz draws without a graphics card."""


def operate() -> FlightOperator:
    """Return an operator of what was launched, as soon as it can take off."""
    # Before, nobody has told yet whether time is simulated.
    wait_for_service("/takeoff")
    operator = FlightOperator(begin("draw_pictures"), limit=LIMIT)
    operator.wait_until_ready()
    return operator


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
    seconds = times[flying] - times[flying][0]
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    path_line = axes.scatter(y, x, c=seconds, s=6, cmap="viridis")
    figure.colorbar(path_line, label="time since it flies (s)")
    for second in range(0, 21, 2):
        k = int(np.searchsorted(seconds, second))
        axes.plot(y[k], x[k], "k.")
        axes.annotate(f"{second} s", (y[k], x[k]), (4, 4), textcoords="offset points", fontsize=8)
        later = min(k + 40, len(x) - 1)
        arrow = {"arrowstyle": "-|>", "color": "black"}
        axes.annotate("", (y[later], x[later]), (y[k], x[k]), arrowprops=arrow)
    axes.invert_xaxis()
    axes.set(xlabel="y (m), to the left", ylabel="x (m), ahead", aspect="equal")
    axes.margins(0.1)
    axes.grid(alpha=0.3)
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
    gains = COURSE.parents[1] / "ros" / "src" / "crazyflie_lqr" / "config" / "K_quadrotor.txt"
    calm = COURSE / "solutions" / "8" / "my_pd" / "config" / "K.txt"
    for name, file in (("K_quadrotor.txt", gains), ("K_calm.txt", calm)):
        with ProcessPoolExecutor(1) as executor:
            record = executor.submit(step, file, log).result()
        start = record.reference.times[record.reference.column("x") == 0.5][0]
        for axes, series, column, scale in (
            (position, record.state, "x", 1.0),
            (tilt, record.final_control, "pitch", np.degrees(1.0)),
        ):
            shown = (series.times >= start) & (series.times <= record.events["land"])
            axes.plot(series.times[shown] - start, scale * series.column(column)[shown], label=name)
    position.axhline(0.5, color="gray", linestyle="--")
    position.set_ylabel("x (m)")
    position.legend(loc="lower right")
    tilt.set(xlabel="time after the step (s)", ylabel="pitch (degrees)", xlim=(0.0, 5.0))
    for axes in (position, tilt):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=90)


@contextlib.contextmanager
def rviz(log: Path, package: str, file: str, *arguments: str, config: Path) -> Iterator[str]:
    """Launch a file with RViz on a virtual display; yield the display's name."""
    with virtual_display(*SCREEN) as display:
        os.environ.update(DISPLAY=display, LIBGL_ALWAYS_SOFTWARE="1")
        with roslaunch([package, file, *arguments, f"config:={config}", "rviz:=true"], log):
            yield display


def save_scene(display: str, config: Path, path: Path) -> None:
    """Write what RViz shows of the scene into a picture."""
    image = Image.fromarray(crop_to_scene(screenshot(display), background_of(config)))
    image.thumbnail((900, 700))
    image.quantize(COLOURS).save(path, optimize=True)


@contextlib.contextmanager
def around_the_pole(log: Path) -> Iterator[str]:
    """Fly around the pole; yield the display when the circle is on it, and then land."""
    with rviz(log, "crazyflie_teleop", "circle.launch", *QUICK, config=POLE_VIEW) as display:
        operator = operate()
        with running("rosrun", "pole", "pole_node"):
            operator.hover(25.0)
            time.sleep(5.0)
            yield display
        operator.land()


def draw_pole(path: Path, log: Path) -> None:
    """Draw the circle around the pole."""
    with around_the_pole(log) as display:
        save_scene(display, POLE_VIEW, path)


def draw_rviz_panel(path: Path, log: Path) -> None:
    """Draw the whole window of RViz, with the panel of the displays."""
    with around_the_pole(log) as display:
        window = Image.fromarray(screenshot(display))
    window.resize((1050, 675)).quantize(128).save(path, optimize=True)


def draw_swarm(path: Path, log: Path) -> None:
    """Draw nine vehicles that hover, from so near that they can be seen."""
    fleet_view = COURSE.parents[1] / "ros/src/crazyflie_fleet/config/fleet.rviz"
    near = log.with_name("near.rviz")
    near.write_text(fleet_view.read_text().replace("Distance: 7", "Distance: 2.3"))
    launch = ["crazyflie_examples", "sw_swarm.launch", "n:=9", "spacing:=0.5", *QUICK[:2]]
    with rviz(log, *launch, config=near) as display:
        wait_for_service("/all/takeoff")
        call("/all/takeoff")
        time.sleep(10.0)
        save_scene(display, near, COURSE.parent / "images" / path.name)
        call("/all/land")


PICTURES = {
    "figure_eight": draw_figure_eight,
    "four_vehicles": draw_four_vehicles,
    "lanes": draw_lanes,
    "main_loop": draw_main_loop,
    "rviz_panel": draw_rviz_panel,
    "sweep": draw_sweep,
    "sw_swarm": draw_swarm,
    "pole": draw_pole,
    "steps": draw_steps,
    **dict.fromkeys(GRAPHS, draw_graph),
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
                print(picture, flush=True)
            os._exit(0)
        status |= os.wait()[1]
    return int(status != 0)


if __name__ == "__main__":
    sys.exit(main())
