"""Pictures from vehicles' cameras, and of a flight after a ball.

    python3 ros/src/crazyflie_tutorials/crazyflie_vision/bench/pictures.py docs/images

flies in a process without ROS, and draws follow_ball.png, follow_ball_flight.png, follow_face.png
and vision_basics.png.
"""

import argparse
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rospkg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from std_srvs.srv import EmptyRequest

from crazyflie_utils.testing import launch_files
from crazyflie_vision.images import to_array

STEP = 0.1  #: Period of the simulation (s).

VEHICLE, TARGET, GREY = "#0b62b0", "#e07b00", "#7a7a7a"


class Flight:
    """A launch file of this package in flight, in a process without ROS."""

    def __init__(self, file: str):
        path = Path(rospkg.RosPack().get_path("crazyflie_vision")) / "launch" / file
        self._process = launch_files.launch(path, 0.0, sim_time="true", simulator_dt="0.01")
        self._process.advance(1.0)
        answer = self._process.call("/takeoff", EmptyRequest())
        while not answer.done():
            self.advance(STEP)
        self.begin = self._process.clock.time()
        self._lookup = self._process.handle("/pictures").listen_to_poses()

    def advance(self, duration: float) -> None:
        """Advance by a duration (s); old images are dropped."""
        for _ in range(round(duration / STEP)):
            self._process.advance(STEP)
            for topic, publisher in self._process.transport.publishers.items():
                if "image" in topic:
                    del publisher.messages[:-1]

    def image(self, topic: str) -> NDArray[Any]:
        """Return the last image of a topic."""
        return to_array(self._process.published(topic)[-1])

    def place(self, frame: str) -> NDArray[np.float64]:
        """Return the position of a frame in the world, m."""
        return np.array(self._lookup("world", frame).position)

    def targets(self) -> NDArray[np.float64]:
        """Return the targets since the takeoff: rows of time (s), x, y (pixels)."""
        rows = [
            (each.header.stamp.to_sec() - self.begin, each.point.x, each.point.y)
            for each in self._process.published("/target")
        ]
        return np.array([row for row in rows if row[0] > 0.0])


def draw_flight(times, vehicle, ball, targets) -> Figure:
    """Return a figure of a flight after a ball: its path, and its errors."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1.0, 1.1))
    above = left.subplots()
    above.plot(*ball[:, :2].T, color=TARGET, label="ball")
    above.plot(*vehicle[:, :2].T, color=VEHICLE, label="vehicle")
    for k in range(0, len(times), round(4.0 / STEP)):
        above.plot(*np.array([vehicle[k, :2], ball[k, :2]]).T, color=GREY, lw=0.6, zorder=0)
    above.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    above.set_title("from above, every 4 s", loc="left", fontsize=10)
    above.legend(frameon=False, loc="upper right")
    pixels, metres = right.subplots(2, 1, sharex=True)
    pixels.plot(targets[:, 0], targets[:, 1] - 159.5, color=VEHICLE, label="to the right")
    pixels.plot(targets[:, 0], targets[:, 2] - 119.5, color=TARGET, label="down")
    pixels.set_ylabel("off the middle, pixels")
    pixels.legend(frameon=False, ncols=2, fontsize=8)
    metres.plot(times, np.linalg.norm(vehicle - ball, axis=1), color=VEHICLE)
    metres.axhline(1.0, color=GREY, lw=0.8, ls=":")
    metres.set(xlabel="time since the takeoff, s", ylabel="distance, m")
    for axes in (above, pixels, metres):
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def follow_ball(folder: Path) -> None:
    """Fly after the ball; write the image with the ball marked, and the flight."""
    flight = Flight("follow_ball.launch")
    times, vehicle, ball = [], [], []
    for step in range(round(48.0 / STEP)):
        flight.advance(STEP)
        times.append((step + 1) * STEP)
        vehicle.append(flight.place("crazyflie"))
        ball.append(flight.place("ball"))
        if step == round(4.0 / STEP):
            cv2.imwrite(str(folder / "follow_ball.png"), flight.image("/tracker/image"))
    figure = draw_flight(np.array(times), np.array(vehicle), np.array(ball), flight.targets())
    figure.savefig(folder / "follow_ball_flight.png", dpi=100)


def follow_face(folder: Path) -> None:
    """Fly after the face; write the image with the face marked."""
    flight = Flight("follow_face.launch")
    flight.advance(4.0)
    cv2.imwrite(str(folder / "follow_face.png"), flight.image("/tracker/image"))


def basics(folder: Path) -> None:
    """Write the images of the camera and the four filters, side by side."""
    flight = Flight("basics.launch")
    flight.advance(1.0)
    topics = ("/camera/image_raw", *(f"/{name}/image" for name in FILTERS))
    tiles = [cv2.resize(flight.image(topic), (240, 180)) for topic in topics]
    for k, name in enumerate(("image_raw", *FILTERS)):
        tiles[k] = cv2.copyMakeBorder(tiles[k], 28, 4, 4, 4, cv2.BORDER_CONSTANT, value=(255,) * 3)
        cv2.putText(tiles[k], name, (8, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, 16)
    cv2.imwrite(str(folder / "vision_basics.png"), np.hstack(tiles))


FILTERS = ("grey", "blur", "edges", "threshold")


def main() -> None:
    """Draw all of them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="folder of the pictures, such as docs/images")
    folder = parser.parse_args().folder
    follow_ball(folder)
    follow_face(folder)
    basics(folder)


if __name__ == "__main__":
    main()
