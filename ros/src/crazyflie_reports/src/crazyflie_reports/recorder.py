"""Records the topics of a flight, and all parameters, into a folder with the date as its name.

rosbag records in a separate process at low priority: its failures, such as a full disk, do not
affect the flight.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import rosgraph
import roslib.packages
import rosparam
import rospkg

from crazyflie_utils.ros1.master_watch import master_answers

#: Regular expression of the recorded topics: those that examples and drivers document, without
#: images.
TOPICS = (
    r"/tf(_static)?|/diagnostics|/rosout|/flights|(/.*)?/("
    r"(full_)?state|state/full_state|ref(/.*)?|ref_descent|control/(lqr|takeoff|merged|final)|in_flight(_.*)?"
    r"|(true_)?pose|goal|cmd_[a-z_]+|external_(pose|position)|battery|rssi|imu|connected|status|vehicle_status"
    r"|parameter_updates)"
)

#: Parameters below "topics" of the nodes that fly a vehicle.
_RENAMED = (
    "state reference control takeoff_control commanded_control final_control merged in_flight"
)

MAX_SIZE = 1024  #: Size of a bag, after which the next one begins (MB).

PARAMETERS = "parameters.yaml"


def topics_of(parameters: Mapping[str, Any]) -> str:
    """Return the regular expression of the documented topics, and of those that nodes have renamed.

    ``parameters`` is the tree of all parameters.
    """
    return "|".join([TOPICS, *sorted(set(_renamed(parameters, "/")))])


def _renamed(tree, node):
    for name, value in tree.items():
        if name == "topics" and isinstance(value, dict):
            for key in value.keys() & _RENAMED.split():
                # The names of its other topics begin with that of in_flight.
                end = "(_.*)?" if key == "in_flight" else ""
                yield re.escape(rosgraph.names.resolve_name(str(value[key]), node)) + end
        elif isinstance(value, dict):
            yield from _renamed(value, f"{node.rstrip('/')}/{name}")


def record(folder: Path, topics: str, ros_arguments: list[str]) -> int:
    """Record until the process is told to stop; print a summary; return the exit status.

    The folder is created if it does not exist; ``topics`` is a regular expression; the arguments
    for the recording node are its name and remappings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rosparam.dump_params(str(folder / PARAMETERS), "/")
    (program,) = roslib.packages.find_node("rosbag", "record")[:1]
    command = [program, "--split", f"--size={MAX_SIZE}", "--lz4", "--tcpnodelay", "--quiet"]
    command += ["-e", topics, "-O", str(folder / "flight.bag")]
    # Its warnings are shown, and not a line for each topic.
    process = subprocess.Popen(
        [*command, *ros_arguments], stdout=subprocess.DEVNULL, preexec_fn=lambda: os.nice(10)
    )
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, lambda number, frame: process.send_signal(signal.SIGINT))
    print(f"recording into {folder}", flush=True)
    status = process.wait()
    bags = [each for each in folder.iterdir() if each.name.endswith((".bag", ".bag.active"))]
    size = sum(each.stat().st_size for each in bags)
    count = f"{len(bags)} bag{'' if len(bags) == 1 else 's'}"
    print(f"recorded {size / 1e6:.1f} MB in {count}: {folder}", flush=True)
    return status


def main() -> int:
    """Record by the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="record_flight", description=__doc__)
    parser.add_argument("--folder", default="", help="folder of all recordings (~/.ros/flights)")
    parser.add_argument("--topics", default="", help="regular expression of additional topics")
    options, ros_arguments = parser.parse_known_args()
    top = Path(options.folder or Path(rospkg.get_ros_home()) / "flights").expanduser()
    folder = top / f"{datetime.now():%Y-%m-%d_%H-%M-%S}"
    if not master_answers():
        print(f"nothing is recorded: no ROS master at {rosgraph.get_master_uri()}", file=sys.stderr)
        return 1
    topics = topics_of(rosparam.get_param("/"))
    if options.topics:
        topics += f"|{options.topics}"
    try:
        return record(folder, topics, ros_arguments)
    except OSError as error:
        print(f"nothing is recorded into {folder}: {error.strerror}", file=sys.stderr)
        return 1
