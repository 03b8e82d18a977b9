"""How fast simulated time passes in one process, without pacing."""

import functools
import subprocess
import tempfile
import time
from pathlib import Path

import rosgraph
import rospkg

from crazyflie_dev.bench import graph
from crazyflie_dev.bench.row import NotMeasuredError, Row
from crazyflie_utils.testing.launch_files import expand
from crazyflie_utils.testing.launching import master
from crazyflie_utils.testing.programs import running

DURATION = 10.0  #: For how long it is measured, s of the machine's clock.

_CLOCK = ("/composed", "/clock", "rosgraph_msgs/Clock")


@functools.cache
def _fly(with_listener):
    """Return how many s of simulated time pass in an s, and in an s of CPU, in a hover."""
    # Not by roslaunch: programs that it starts beside the nodes listen to /clock, too.
    launch_file = Path(rospkg.RosPack().get_path("crazyflie_examples")) / "launch/sw_hover.launch"
    _, parameters = expand(
        launch_file, rviz=False, composed=True, sim_time=True, real_time_factor=0
    )
    with tempfile.TemporaryDirectory() as folder, master(Path(folder) / "master"):
        server = rosgraph.Master("/bench")
        for name, value in parameters.items():
            server.setParam(name, value)
        log = (Path(folder) / "log").open("w")
        command = ["rosrun", "crazyflie_utils", "composed_node", "__name:=composed"]
        with log, running(*command, stdout=log, stderr=subprocess.STDOUT):
            graph.wait_for_service("/takeoff")
            graph.call("/takeoff")
            process = [graph.process_of("/composed")]
            used = graph.cpu_time(process)
            arrivals = _listen(with_listener)
            used = graph.cpu_time(process) - used
    if len(arrivals) < 2:
        raise NotMeasuredError("nothing came on /clock")
    (_, begin, first), (_, end, last) = arrivals[0], arrivals[-1]
    return (last - first) / (end - begin), (last - first) * 1e-9 / used


def _listen(with_listener):
    if with_listener:
        return graph.listen(DURATION, _CLOCK)
    first = graph.listen(0.2, _CLOCK)
    time.sleep(DURATION)
    return [first[0], graph.listen(0.2, _CLOCK)[-1]]


def _rows(name, words, least):
    return [
        Row(
            f"simulated_time{name}",
            f"simulated time, {words}",
            "x real time",
            lambda: _fly(bool(name))[0],
            least=least,
        ),
        Row(
            f"simulated_cpu{name}",
            f"simulated time per CPU time, {words}",
            "s/s",
            lambda: _fly(bool(name))[1],
            least=least,
        ),
    ]


ROWS = [
    *_rows("", "without a listener", 100.0),
    *_rows("_watched", "with a listener on /clock", 40.0),
]
