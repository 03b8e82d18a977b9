#!/usr/bin/env python
"""What a message and a timer cost, on a master of its own; prints a table.

Run it in a shell that has sourced the workspace:

    python3 ros/src/crazyflie_utils/bench/costs.py

Wall time is per piece of work; CPU time is this process's, with all its threads.
Nothing is asserted: the figures depend on the machine and on its other work.
"""

import os
import queue
import socket
import subprocess
import sys
import threading
import time

import rospy

from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils import Node, run
from crazyflie_utils.runtime.runner import begin

_COUNT = 5000
_LIMIT = 30.0
_PERIOD = 0.001


def main() -> None:
    """Measure and print."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    os.environ.pop("ROS_HOSTNAME", None)
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL)
    echo = subprocess.Popen([sys.executable, __file__, "echo"])
    try:
        _measure()
    finally:
        for process in (echo, master):
            process.terminate()
            process.wait(_LIMIT)


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

    print(f"{'':44}{'wall':>10}{'CPU':>10}")
    _report("publish, nobody listens", *_per_call(publish_to("/nobody", 0)))
    _report("publish, 1 subscriber in the process", *_per_call(publish_to("/one", 1)))
    _report("publish, 10 subscribers in the process", *_per_call(publish_to("/ten", 10)))

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

    _report("to another process and back", *_per_call(there_and_back))

    _report(f"timer tick, every {_PERIOD * 1e3:g} ms", *_per_tick(handle))
    process.stop()
    rospy.signal_shutdown("done")


def _per_call(work):
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(_COUNT):
        work()
    return [(time.perf_counter() - wall) / _COUNT, (time.process_time() - cpu) / _COUNT]


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
