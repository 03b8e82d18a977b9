"""Draws flights of the tutorials, with range sensors and with a camera.

``python3 -m crazyflie_dev.flight_pictures docs/images`` flies in a process without ROS, and writes
the pictures of crazyflie_ranging and crazyflie_vision into a folder.
"""

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rospkg
from geometry_msgs.msg import Twist, Vector3
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle, Wedge
from numpy.typing import NDArray
from std_srvs.srv import EmptyRequest

from crazyflie_ranging.range_sensors import DIRECTIONS
from crazyflie_utils.testing import launch_files
from crazyflie_vision.images import to_array
from crazyflie_world import world_file
from crazyflie_world.shapes import Box
from crazyflie_world.world import World

SIDES = ("front", "back", "left", "right")
FILTERS = ("grey", "blur", "edges", "threshold")
STEP = 0.05  #: Period of the moments (s).
SPREAD = 0.47  #: Angle of the sensors' cones (rad).

VEHICLE, TARGET, CONE, GREY = "#0b62b0", "#e07b00", "#7fb2e5", "#7a7a7a"


@dataclass(frozen=True)
class Moment:
    """The vehicle, its range sensors and the world at a moment."""

    time: float  #: Time since the takeoff (s).
    position: tuple[float, float, float]  #: Position of the vehicle (m).
    ranges: dict[str, float]  #: Reading of each sensor (m).
    command: float  #: Commanded velocity ahead (m/s).
    world: World


class Flight:
    """A launch file of a tutorial in flight, in a process without ROS."""

    def __init__(self, package: str, file: str, **arguments: str):
        path = Path(rospkg.RosPack().get_path(package)) / "launch" / file
        self.process = launch_files.launch(path, 0.0, simulator_dt="0.01", **arguments)
        self._world = world_file.load(str(self.process.transport.parameters["/world/world"]))
        self.process.advance(1.0)
        answer = self.process.call("/takeoff", EmptyRequest())
        while not answer.done():
            self.process.advance(0.1)
        self.begin = self.process.clock.time()
        self._lookup = self.process.handle("/pictures").listen_to_poses()

    def watch(self, duration: float) -> list[Moment]:
        """Advance by a duration (s); return the moments. Old images are dropped."""
        return [self._next() for _ in range(round(duration / STEP))]

    def image(self, topic: str) -> NDArray[Any]:
        """Return the last image of a topic."""
        return to_array(self.process.published(topic)[-1])

    def _next(self):
        self.process.advance(STEP)
        last = {}
        for topic, publisher in self.process.transport.publishers.items():
            last[topic] = publisher.messages[-1:]
            if "image" in topic:
                publisher.messages[:] = last[topic]
        commands = last.get("/cmd_vel")
        return Moment(
            self.process.clock.time() - self.begin,
            self._place("crazyflie"),
            {side: r.range for side in SIDES for r in last.get(f"/range/{side}", ())},
            commands[0].linear.x if commands else 0.0,
            self._world.placed({each.name: self._place(each.name) for each in self._world.moving}),
        )

    def _place(self, frame):
        return self._lookup("world", frame).position


def panes() -> tuple[Figure, Axes, Axes, Axes]:
    """Return a figure with a view from above at the left and two diagrams at the right."""
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(5, 6))
    above = figure.add_subplot(grid[:, 0], aspect="equal", xlabel="x, m", ylabel="y, m")
    top = figure.add_subplot(grid[0, 1])
    bottom = figure.add_subplot(grid[1, 1], sharex=top, xlabel="time since the takeoff, s")
    for axes in (top, bottom):
        axes.grid(color="#e6e6e6")
        axes.spines[["top", "right"]].set_visible(False)
    return figure, above, top, bottom


def draw_room(axes: Axes, moment: Moment) -> None:
    """Draw a moment as seen from above."""
    for each in moment.world.objects:
        colour = TARGET if each.path is not None else "#c9c5bb"
        if isinstance(each, Box):
            (x, y, _), (width, depth, _) = each.centre, each.extent
            corner, turn = (x - width / 2.0, y - depth / 2.0), math.degrees(each.yaw)
            box = Rectangle(corner, width, depth, angle=turn, rotation_point="center")
            box.set(fc=colour, ec=GREY, lw=0.6)
            axes.add_patch(box)
        else:
            axes.add_patch(Circle(each.centre[:2], each.size[0] / 2.0, fc=colour, ec=GREY, lw=0.6))
    place = moment.position[:2]
    for side, reading in moment.ranges.items():
        if math.isfinite(reading):
            middle = math.degrees(DIRECTIONS[side][2])
            half = math.degrees(SPREAD / 2.0)
            axes.add_patch(Wedge(place, reading, middle - half, middle + half, fc=CONE, alpha=0.5))
    axes.add_patch(Circle(place, 0.07, fc=VEHICLE))
    width, depth = moment.world.floor.size
    x, y = width / 2.0 + 0.15, depth / 2.0 + 0.15
    axes.set(xlim=(-x, x), ylim=(-y, y))
    axes.set_title(f"{moment.time:.0f} s after the takeoff, from above", loc="left", fontsize=10)


def follow_object(folder: Path) -> None:
    """Follow the box for one round of its path, and draw it."""
    flight = Flight("crazyflie_ranging", "follow_object.launch", takeoff="false")
    moments = flight.watch(34.0)
    figure, room, top, bottom = panes()
    draw_room(room, moments[round(9.0 / STEP)])
    time = [each.time for each in moments]
    fronts = [each.world["box"].centre[0] - each.world["box"].size[0] / 2.0 for each in moments]
    top.plot(time, fronts, color=TARGET, label="front of the box")
    top.plot(time, [each.position[0] for each in moments], color=VEHICLE, label="vehicle")
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
    figure.savefig(folder / "follow_object.png", dpi=110)


def obstacle_stop(folder: Path) -> None:
    """Command 0.5 m/s ahead all the time, and draw where the vehicle stops."""
    flight = Flight("crazyflie_ranging", "teleop_with_obstacle_stop.launch", joy="false")
    moments = []
    for _ in range(round(8.0 / STEP)):
        flight.process.publish("/cmd_vel/wanted", Twist(linear=Vector3(x=0.5)))
        moments += flight.watch(STEP)
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
    figure.savefig(folder / "obstacle_stop.png", dpi=110)


def follow_ball(folder: Path) -> None:
    """Fly after the ball; write the image with the ball marked, and the flight."""
    flight = Flight("crazyflie_vision", "follow_ball.launch")
    moments = flight.watch(4.0)
    cv2.imwrite(str(folder / "follow_ball.png"), flight.image("/tracker/image"))
    moments += flight.watch(44.0)
    time = [each.time for each in moments]
    vehicle = np.array([each.position for each in moments])
    ball = np.array([each.world["ball"].centre for each in moments])
    figure, above, top, bottom = panes()
    above.plot(*ball[:, :2].T, color=TARGET, label="ball")
    above.plot(*vehicle[:, :2].T, color=VEHICLE, label="vehicle")
    for k in range(0, len(time), round(4.0 / STEP)):
        above.plot(*np.array([vehicle[k, :2], ball[k, :2]]).T, color=GREY, lw=0.6, zorder=0)
    above.set_title("from above, every 4 s", loc="left", fontsize=10)
    above.legend(frameon=False, loc="upper right")
    targets = np.array(
        [
            (each.header.stamp.to_sec() - flight.begin, each.point.x - 159.5, each.point.y - 119.5)
            for each in flight.process.published("/target")
        ]
    )
    targets = targets[targets[:, 0] > 0.0]
    top.plot(targets[:, 0], targets[:, 1], color=VEHICLE, label="to the right")
    top.plot(targets[:, 0], targets[:, 2], color=TARGET, label="down")
    top.set_ylabel("off the middle, pixels")
    top.legend(frameon=False, ncols=2, fontsize=8)
    bottom.plot(time, np.linalg.norm(vehicle - ball, axis=1), color=VEHICLE)
    bottom.axhline(1.0, color=GREY, lw=0.8, ls=":")
    bottom.set_ylabel("distance, m")
    figure.savefig(folder / "follow_ball_flight.png", dpi=100)


def follow_face(folder: Path) -> None:
    """Fly after the face; write the image with the face marked."""
    flight = Flight("crazyflie_vision", "follow_face.launch")
    flight.watch(4.0)
    cv2.imwrite(str(folder / "follow_face.png"), flight.image("/tracker/image"))


def vision_basics(folder: Path) -> None:
    """Write the images of the camera and the four filters, side by side."""
    flight = Flight("crazyflie_vision", "basics.launch")
    flight.watch(1.0)
    tiles = []
    for topic in ("camera/image_raw", *(f"{name}/image" for name in FILTERS)):
        tile = cv2.resize(flight.image(f"/{topic}"), (240, 180))
        tile = cv2.copyMakeBorder(tile, 28, 4, 4, 4, cv2.BORDER_CONSTANT, value=(255,) * 3)
        name = topic.removeprefix("camera/").removesuffix("/image")
        cv2.putText(tile, name, (8, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, 16)
        tiles.append(tile)
    cv2.imwrite(str(folder / "vision_basics.png"), np.hstack(tiles))


def main() -> None:
    """Draw all of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, help="folder of the pictures, such as docs/images")
    folder = parser.parse_args().folder
    for draw in (follow_object, obstacle_stop, follow_ball, follow_face, vision_basics):
        draw(folder)


if __name__ == "__main__":
    main()
