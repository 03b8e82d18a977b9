"""A figure eight of the software example, flown without ROS as fast as it goes, as a bag.

The recorded flight of the examples, in the folder ``flights``, is made by

    ./run shell
    python3 ros/src/crazyflie_examples/test/figure_eight_flight.py
"""

import math
import re
from pathlib import Path

import genpy
import rosbag
import rospkg
from std_srvs.srv import EmptyRequest

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
)
from crazyflie_reports.recorder import TOPICS
from crazyflie_utils.testing import launch_files
from crazyflie_utils.vectors import stamped

FOLDER = Path(rospkg.RosPack().get_path("crazyflie_examples"))
BAG = FOLDER / "flights" / "figure_eight.bag"
WIDTH, HEIGHT, DURATION = 0.75, 0.375, 12.0  #: Amplitudes (m), time of the figure (s).
HOVER = 3.0  #: Time at the hover point before and after the figure (s).
PERIOD = 0.05  #: Period of the references (s).
LIMIT = 20.0  #: Longest takeoff, and longest landing (s).
_OMITTED = r"/diagnostics|/rosout|/flights"


def reference(time):
    """Return position (m) and velocity (m/s) at a time of the figure (s), which begins at rest."""
    share = min(time / DURATION, 1.0)
    phase = 2.0 * math.pi * share - math.sin(2.0 * math.pi * share)
    rate = 2.0 * math.pi / DURATION * (1.0 - math.cos(2.0 * math.pi * share))
    x, y = WIDTH * math.sin(phase), HEIGHT * math.sin(2.0 * phase)
    return PositionVelocityState(
        x, y, 1.0, WIDTH * rate * math.cos(phase), 2.0 * HEIGHT * rate * math.cos(2.0 * phase), 0.0
    )


def fly(path, start=1_790_000_000.0, prepare=None, **arguments):
    """Fly, with arguments of sw_hover.launch, and write the bag; return its path.

    ``prepare(process)`` is called before the takeoff.
    """
    launch = FOLDER / "launch" / "sw_hover.launch"
    process = launch_files.launch(launch, 0.0, simulator_dt=0.01, **arguments)
    process.clock.wall_offset = start
    states = [FlightStatus.UNKNOWN]
    with rosbag.Bag(str(path), "w", "bz2") as bag:

        def write(topic, message, caller="/composed"):
            now = process.clock.time()
            if isinstance(message, FlightStatus):
                states.append(message.state)
            if re.fullmatch(TOPICS, topic) and not re.fullmatch(_OMITTED, topic):
                header = {
                    "callerid": caller,
                    "topic": topic,
                    "type": message._type,
                    "md5sum": message._md5sum,
                    "message_definition": message._full_text,
                }
                stamp = genpy.Time.from_sec(start + now)
                bag.write(topic, message, stamp, connection_header=header)

        def fly_until(state):
            end = process.clock.time() + LIMIT
            while states[-1] != state:
                assert process.clock.time() < end, f"{process.logged('warn')[-3:]}"
                process.advance(0.1)

        process.transport.on_publish = write
        if prepare is not None:
            prepare(process)
        process.advance(1.0)
        process.call("/takeoff", EmptyRequest())
        fly_until(FlightStatus.FLYING)
        process.advance(HOVER)
        for step in range(round((DURATION + HOVER) / PERIOD)):
            message = stamped(
                PositionVelocityStateStamped,
                process.clock.stamp(),
                state=reference(step * PERIOD),
            )
            write("/ref", message, "/figure_eight")
            process.publish("/ref", message)
            process.advance(PERIOD)
        process.call("/land", EmptyRequest())
        fly_until(FlightStatus.ON_GROUND)
        process.advance(1.0)
    return path


if __name__ == "__main__":
    BAG.parent.mkdir(exist_ok=True)
    print(fly(BAG), BAG.stat().st_size, "bytes")
