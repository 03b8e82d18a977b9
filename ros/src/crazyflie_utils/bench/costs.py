#!/usr/bin/env python
"""Measures the time of messages and timers, on a master of its own; prints a table.

Run it in a shell that has sourced the workspace:

    python3 ros/src/crazyflie_utils/bench/costs.py

With CRAZYFLIE_ROSPY_PATCHES=none, or all names of its patches but one, it shows their effect.
Wall time is per piece of work; CPU time is this process's, with all its threads.
Nothing is asserted: the figures depend on the machine and on its other work.
"""

import contextlib
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import rospy

from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils import Node, TransformError, run
from crazyflie_utils.main import begin
from crazyflie_utils.ros1 import patches
from crazyflie_utils.testing.launching import master
from crazyflie_utils.testing.programs import running

_COUNT = 5000
_TOPICS = 100
_LIMIT = 30.0
_PERIOD = 0.001


def main() -> None:
    """Measure and print."""
    os.environ.pop("ROS_HOSTNAME", None)
    with tempfile.TemporaryDirectory() as folder, master(Path(folder) / "master.log"):
        with running(sys.executable, __file__, "echo"):
            _measure()


def _measure():
    process = begin("costs")
    handle = process.handle("/costs")
    process.start()
    message = ControlStamped()

    def publish_to(topic, subscribers):
        publisher = handle.publisher(topic, ControlStamped)
        for _ in range(subscribers):
            handle.subscribe(topic, ControlStamped, lambda message: None)
        return lambda: publisher.publish(message)

    print(f"patches of rospy: {', '.join(sorted(patches.active())) or 'none'}")
    print(f"{'':44}{'wall':>10}{'CPU':>10}")
    _report("announce a topic while nodes start", *_per_topic(process, handle))
    works = {
        "publish without subscribers": publish_to("/unheard", 0),
        "publish, 1 subscriber in the process": publish_to("/one", 1),
        "publish, 10 subscribers in the process": publish_to("/ten", 10),
    }
    # Without its patch, rospy connects the process to itself.
    time.sleep(2.0)
    for name, work in works.items():
        _report(name, *_per_call(work))

    back = queue.Queue()
    handle.subscribe("/back", ControlStamped, back.put)
    to_echo = publish_to("/there", 0)
    end = time.monotonic() + _LIMIT
    while back.empty():
        if time.monotonic() > end:
            sys.exit("the other process does not answer")
        to_echo()
        threading.Event().wait(0.1)
    while not back.empty():
        back.get()

    def there_and_back():
        to_echo()
        back.get(timeout=_LIMIT)

    _report("to another process and back", *_per_call(there_and_back, pause=0.001))

    _report("/tf at 1 kHz, the frame looked up at 100 Hz", *_per_transform(handle, '"cf"'))
    _report("/tf at 1 kHz, another frame", *_per_transform(handle, '"other"'))
    _report("/tf at 1 kHz, 80 other frames", *_per_transform(handle, None))

    _report(f"timer tick, every {_PERIOD * 1e3:g} ms", *_per_tick(handle))
    process.stop()
    rospy.signal_shutdown("done")


def _per_topic(process, handle):
    wall, cpu = time.perf_counter(), time.process_time()
    with process.transport.starting():
        for number in range(_TOPICS):
            handle.publisher(f"/topic{number}", ControlStamped)
    return [(time.perf_counter() - wall) / _TOPICS, (time.process_time() - cpu) / _TOPICS]


def _per_call(work, pause=0.0):
    wall, cpu = 0.0, time.process_time()
    for _ in range(_COUNT):
        start = time.perf_counter()
        work()
        wall += time.perf_counter() - start
        # More than 2000 messages a second would be a flood.
        if pause:
            time.sleep(pause)
    return [wall / _COUNT, (time.process_time() - cpu) / _COUNT]


def _per_transform(handle, frame):
    content = "80"
    if frame is not None:
        content = (
            "transforms: [{header: {stamp: now, frame_id: world}, "
            f"child_frame_id: {frame}, transform: {{rotation: {{w: 1.0}}}}}}]"
        )
    lookup = handle.listen_to_transforms()

    def look():
        with contextlib.suppress(TransformError):
            lookup("world", "cf")

    look()
    module = "crazyflie_utils.testing.hostile_publisher"
    command = [sys.executable, "-m", module, "/tf", "tf2_msgs/TFMessage", "1000", content]
    timer = handle.timer(0.01, look)
    flood = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    flood.stdin.write("begin\n")
    flood.stdin.flush()
    time.sleep(2.0)
    wall, cpu = time.perf_counter(), time.process_time()
    time.sleep(_COUNT / 1000.0)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    _, rate = flood.communicate("end\n", timeout=_LIMIT)[0].split()
    timer.stop()
    count = wall * float(rate)
    return [wall / count, cpu / count, "wall: from one to the next; CPU with the timer's"]


def _per_tick(handle):
    late, done = [], threading.Event()
    begin = handle.time()

    def tick():
        late.append((handle.time() - begin) % _PERIOD)
        if len(late) == _COUNT // 2:
            done.set()

    cpu = time.process_time()
    timer = handle.timer(_PERIOD, tick)
    if not done.wait(_LIMIT):
        sys.exit("the timer does not fire")
    timer.stop()
    return [sum(late) / len(late), (time.process_time() - cpu) / len(late), "late on average"]


def _report(name, wall, cpu, note=""):
    print(f"{name:44}{wall * 1e6:7.1f} us{cpu * 1e6:7.1f} us  {note}".rstrip())


class _Echo(Node):
    """Sends every message back."""

    def load_parameters(self, handle):
        """See `Node.load_parameters`."""

    def register_callbacks(self, handle):
        """See `Node.register_callbacks`."""
        back = handle.publisher("/back", ControlStamped)
        handle.subscribe("/there", ControlStamped, back.publish)


if __name__ == "__main__":
    run(_Echo, "echo") if sys.argv[1:] == ["echo"] else main()
