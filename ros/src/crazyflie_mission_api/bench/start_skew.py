#!/usr/bin/env python
"""Measures the skew with which vehicles behind the driver begin a common command.

Run it in a shell that has sourced the workspace:

    python3 ros/src/crazyflie_mission_api/bench/start_skew.py 2 5 10

The vehicles are stand-ins behind the radio's protocol, by UDP; between them and this script is the
driver, in a process of its own. The script commands all of them as a mission does, and each records
the arrival of its packet: the time from the first to the last is the skew. With `--broadcast` they
are commanded by the driver's service for all, and their number is the largest. Prints a line for
each number of vehicles (ms). It does not include that a Crazyradio sends one packet after the
other. Nothing is asserted.
"""

import argparse
import contextlib
import os
import socket
import statistics
import time

import genpy

from crazyflie_driver.srv import AddCrazyflie, AddCrazyflieRequest, GoTo, GoToRequest
from crazyflie_mission_api.ros_vehicle import RosVehicle
from crazyflie_utils.main import begin_script
from crazyflie_utils.testing.programs import free_port, running
from crazyflie_utils.testing.waiting import wait_until
from crazyflie_virtual.testing import FakeVehicle

COMMANDS = (8, 0, b"\x0c")  #: Port, channel and first byte of a go_to.

ALL = "/crazyflie_server/all/go_to"
_RELATIVE = GoToRequest(relative=True, duration=genpy.Duration(1))

SERVICES = ("go_to", "emergency")
PAUSE = 0.2  #: Time between two commands to all vehicles (s).


class Vehicle(FakeVehicle):
    """A stand-in that records the arrival of commands, s of the machine's clock."""

    def __init__(self) -> None:
        self.times: list[float] = []
        super().__init__()

    def _reply(self, port, channel, data):
        if (port, channel, data[:1]) == COMMANDS:
            self.times.append(time.monotonic())
        super()._reply(port, channel, data)


def main() -> None:
    """Measure by the options of the command line, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("n", nargs="+", type=int, help="of vehicles")
    parser.add_argument("--commands", type=int, default=100, help="to all of them (100)")
    parser.add_argument("--broadcast", action="store_true", help="by the driver's service for all")
    options = parser.parse_args()
    most = max(options.n)
    port = free_port(socket.SOCK_STREAM)
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    launch = ("roslaunch", "-p", port, "crazyflie_driver", "crazyflie_server.launch")
    with contextlib.ExitStack() as stack:
        stand_ins = [stack.enter_context(Vehicle()) for _ in range(most)]
        stack.enter_context(running(*launch))
        process, end = begin_script("start_skew")
        stack.callback(end)
        handle = process.handle("/start_skew")
        process.start()
        wait_until(lambda: "/add_crazyflie" in handle.service_nodes(), "the driver")
        vehicles = []
        for k, stand_in in enumerate(stand_ins, start=1):
            request = AddCrazyflieRequest(uri=stand_in.uri, tf_prefix=f"cf{k}")
            handle.call_service("/add_crazyflie", AddCrazyflie, request, 60.0).result(60.0)
            services = {service: f"/cf{k}/{service}" for service in SERVICES}
            vehicles.append(RosVehicle(f"cf{k}", handle, services))
        print("  n  median    95 %     max", flush=True)
        for n in options.n:

            def command(n=n):
                if options.broadcast:
                    return [handle.call_service(ALL, GoTo, _RELATIVE, 60.0)]
                return [vehicle.go_to((0.0, 0.0, 1.0), 0.0, 1.0) for vehicle in vehicles[:n]]

            n = most if options.broadcast else n
            skews = [_skew(command, stand_ins[:n]) for _ in range(options.commands)]
            figures = statistics.median(skews), statistics.quantiles(skews, n=20)[-1], max(skews)
            print(f"{n:3d}", *(f"{1e3 * figure:7.1f}" for figure in figures), flush=True)


def _skew(command, stand_ins):
    for stand_in in stand_ins:
        stand_in.times.clear()
    for answer in command():
        answer.result(60.0)
    times = [stand_in.times[0] for stand_in in stand_ins]
    time.sleep(PAUSE)
    return max(times) - min(times)


if __name__ == "__main__":
    main()
