"""Pictures of two flights: behind a box, and by hand towards a wall.

    python3 ros/src/crazyflie_tutorials/crazyflie_ranging/bench/pictures.py docs/images

flies both in a process without ROS, and draws follow_object.png and obstacle_stop.png.
"""

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import rospkg
from geometry_msgs.msg import Twist, Vector3
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle, Wedge
from std_srvs.srv import EmptyRequest

from crazyflie_ranging.range_sensors import DIRECTIONS
from crazyflie_utils.testing import launch_files
from crazyflie_world import world_file
from crazyflie_world.shapes import Box
from crazyflie_world.world import World

SIDES = ("front", "back", "left", "right")
STEP = 0.05  #: Period of the simulation (s).
SPREAD = 0.47  #: Angle of the sensors' cones (rad).

VEHICLE, OBJECT, CONE, GREY = "#0b62b0", "#e07b00", "#7fb2e5", "#7a7a7a"


@dataclass(frozen=True)
class Moment:
    """The vehicle, its sensors and the world at a moment."""

    time: float  #: Time since the takeoff (s). x, y: Position of the vehicle (m).
    x: float
    y: float
    ranges: dict[str, float]  #: Reading of each sensor (m).
    command: float  #: Commanded velocity ahead (m/s).
    world: World


class Flight:
    """A launch file of this package in flight, in a process without ROS."""

    def __init__(self, file: str, **arguments: str):
        path = Path(rospkg.RosPack().get_path("crazyflie_ranging")) / "launch" / file
        self.process = launch_files.launch(path, 0.0, simulator_dt="0.01", **arguments)
        self._world = world_file.load(str(self.process.transport.parameters["/world/world"]))
        self.process.advance(1.0)
        answer = self.process.call("/takeoff", EmptyRequest())
        while not answer.done():
            self.process.advance(0.1)
        self._begin = self.process.clock.time()
        self._lookup = self.process.handle("/pictures").listen_to_poses()

    def watch(self) -> Moment:
        """Advance by `STEP`; return the moment after it."""
        self.process.advance(STEP)
        x, y, _ = self._place("crazyflie")
        commands = self.process.published("/cmd_vel")
        return Moment(
            self.process.clock.time() - self._begin,
            x,
            y,
            {side: self.process.published(f"/range/{side}")[-1].range for side in SIDES},
            commands[-1].linear.x if commands else 0.0,
            self._world.placed({each.name: self._place(each.name) for each in self._world.moving}),
        )

    def _place(self, frame):
        return self._lookup("world", frame).position


def draw_room(axes: Axes, moment: Moment) -> None:
    """Draw a moment as seen from above."""
    for each in moment.world.objects:
        colour = OBJECT if each.path is not None else "#c9c5bb"
        if isinstance(each, Box):
            (x, y, _), (width, depth, _) = each.centre, each.extent
            corner, turn = (x - width / 2.0, y - depth / 2.0), math.degrees(each.yaw)
            box = Rectangle(corner, width, depth, angle=turn, rotation_point="center")
            box.set(fc=colour, ec=GREY, lw=0.6)
            axes.add_patch(box)
        else:
            axes.add_patch(Circle(each.centre[:2], each.size[0] / 2.0, fc=colour, ec=GREY, lw=0.6))
    for side, reading in moment.ranges.items():
        if math.isfinite(reading):
            middle = math.degrees(DIRECTIONS[side][2])
            half = math.degrees(SPREAD / 2.0)
            cone = Wedge(
                (moment.x, moment.y), reading, middle - half, middle + half, fc=CONE, alpha=0.5
            )
            axes.add_patch(cone)
    axes.add_patch(Circle((moment.x, moment.y), 0.07, fc=VEHICLE))
    width, depth = moment.world.floor.size
    x, y = width / 2.0 + 0.15, depth / 2.0 + 0.15
    axes.set(xlim=(-x, x), ylim=(-y, y), aspect="equal", xlabel="x, m", ylabel="y, m")
    axes.set_title(f"{moment.time:.0f} s after the takeoff, from above", loc="left", fontsize=10)


def panes() -> tuple[Figure, Axes, Axes, Axes]:
    """Return a figure with a room at the left and two diagrams at the right."""
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(5, 6))
    room = figure.add_subplot(grid[:, 0])
    top = figure.add_subplot(grid[0, 1])
    bottom = figure.add_subplot(grid[1, 1], sharex=top)
    for axes in (top, bottom):
        axes.grid(color="#e6e6e6")
        axes.spines[["top", "right"]].set_visible(False)
    bottom.set_xlabel("time since the takeoff, s")
    return figure, room, top, bottom


def follow_object(path: Path) -> None:
    """Follow the box for one round of its path, and draw it."""
    flight = Flight("follow_object.launch", takeoff="false")
    moments = [flight.watch() for _ in range(round(34.0 / STEP))]
    figure, room, top, bottom = panes()
    draw_room(room, moments[round(9.0 / STEP)])
    time = [each.time for each in moments]
    fronts = [each.world["box"].centre[0] - each.world["box"].size[0] / 2.0 for each in moments]
    top.plot(time, fronts, color=OBJECT, label="front of the box")
    top.plot(time, [each.x for each in moments], color=VEHICLE, label="vehicle")
    top.set_ylabel("x, m")
    top.legend(loc="upper right", fontsize=8)
    bottom.plot(time, [each.ranges["front"] for each in moments], color=VEHICLE)
    for distance, text, side in (
        (0.6, "follows beyond", "bottom"),
        (0.3, "backs off below", "top"),
    ):
        bottom.axhline(distance, color=GREY, ls="--", lw=0.8)
        bottom.text(time[-1], distance, text, fontsize=8, color=GREY, ha="right", va=side)
    command = [each.command for each in moments]
    for name, colour, is_sent in (
        ("0.3 m/s ahead", "#8fd19e", [v > 0.0 for v in command]),
        ("0.3 m/s back", "#f2b5b5", [v < 0.0 for v in command]),
    ):
        bottom.fill_between(time, 0.0, 0.9, is_sent, color=colour, alpha=0.6, lw=0, label=name)
    bottom.legend(loc="lower left", fontsize=8, title="command, else 0", title_fontsize=8)
    bottom.set(ylim=(0.0, 0.9), ylabel="sensor in front, m")
    figure.savefig(path, dpi=110)


def obstacle_stop(path: Path) -> None:
    """Command 0.5 m/s ahead all the time, and draw where the vehicle stops."""
    flight = Flight("teleop_with_obstacle_stop.launch", joy="false")
    moments = []
    for _ in range(round(8.0 / STEP)):
        flight.process.publish("/cmd_vel/wanted", Twist(linear=Vector3(x=0.5)))
        moments.append(flight.watch())
    figure, room, top, bottom = panes()
    draw_room(room, moments[-1])
    time = [each.time for each in moments]
    top.axhline(0.5, color=GREY, ls="--", lw=1.0, label="asked for")
    top.plot(time, [each.command for each in moments], color=VEHICLE, label="passed on")
    top.set(ylim=(-0.02, 0.6), ylabel="velocity ahead, m/s")
    top.legend(loc="upper right", fontsize=8)
    bottom.plot(time, [each.ranges["front"] for each in moments], color=VEHICLE)
    bottom.axhline(0.5, color=GREY, ls="--", lw=0.8)
    bottom.text(
        time[-1], 0.45, "distance that is kept", fontsize=8, color=GREY, ha="right", va="top"
    )
    bottom.set(ylim=(0.0, None), ylabel="sensor in front, m")
    figure.savefig(path, dpi=110)


def main() -> None:
    """Fly and draw."""
    parser = argparse.ArgumentParser(description="Draw flights with range sensors.")
    parser.add_argument("folder", type=Path, help="folder of the pictures, such as docs/images")
    folder = parser.parse_args().folder
    follow_object(folder / "follow_object.png")
    obstacle_stop(folder / "obstacle_stop.png")


if __name__ == "__main__":
    main()
