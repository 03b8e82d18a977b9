#!/usr/bin/env python
"""Measures the hover stack under attack by other nodes: rate of the control, memory of the nodes.

Start `roslaunch crazyflie_examples sw_hover.launch rviz:=false` in one shell and this in
another; it prints a line for each attack, with the undisturbed rate just before it. Nothing
is asserted: the figures depend on the machine, and on what else it does.
"""

import os
import signal
import subprocess
import sys
import time

import rospy
from tf2_msgs.msg import TFMessage

from crazyflie_dev import bench_flights
from crazyflie_msgs.msg import (
    ControlStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)

_DURATION = 10.0
_NODES = ("state_estimator", "lqr_controller", "takeoff_control_filter", "takeoff_server")

_FLOOD = (sys.executable, "-m", "crazyflie_utils.testing.hostile_publisher")
_ATTACKS = {
    "none": None,
    "junk, 10 kHz": (
        *_FLOOD,
        "/in_flight_flight_status",
        "crazyflie_msgs/FlightStatus",
        "10000",
        "{state: 3}",
    ),
    "/ref, 10 kHz": (*_FLOOD, "/ref", "crazyflie_msgs/PositionVelocityStateStamped", "10000"),
    "no frames, 10 kHz": (*_FLOOD, "/tf", "tf2_msgs/TFMessage", "10000", "transforms: [{}]"),
    "/tf, 20 MB/s": (*_FLOOD, "/tf", "tf2_msgs/TFMessage", "2500", "80"),
    "frozen listener": (sys.executable, __file__, "freeze"),
}


def main() -> None:
    """Run all attacks, one after the other."""
    if sys.argv[1:] == ["freeze"]:
        freeze()
    rospy.init_node("victim_watch")
    controls = []
    rospy.Subscriber("/control/lqr", ControlStamped, lambda _: controls.append(1), tcp_nodelay=True)
    # The controller is silent without a reference.
    reference = rospy.Publisher("/ref", PositionVelocityStateStamped, latch=True, queue_size=1)
    reference.publish(PositionVelocityStateStamped())
    time.sleep(3.0)

    def rate():
        del controls[:]
        start = time.monotonic()
        time.sleep(_DURATION)
        return len(controls) / (time.monotonic() - start)

    processes = [bench_flights.process_of(f"/{name}") for name in _NODES]

    def memory():
        return [bench_flights.memory([process]) for process in processes]

    print(
        f"{'attack':<18}{'before':>8}{'control, Hz':>13}{'sent, Hz':>14}   memory, MiB, of", *_NODES
    )
    for kind, command in _ATTACKS.items():
        before = rate()
        attacker = None
        if command:
            attacker = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            time.sleep(3.0)
            begin(attacker)
        time.sleep(1.0)
        memory_before = memory()
        under_attack = rate()
        growth = ", ".join(
            f"{b:.1f} -> {a:.1f}" for b, a in zip(memory_before, memory(), strict=True)
        )
        sent = end(attacker) if attacker else ""
        print(f"{kind:<18}{before:>8.1f}{under_attack:>13.1f}{sent:>14}   {growth}", flush=True)


def begin(attacker: subprocess.Popen[bytes]) -> None:
    """Start an attacker."""
    assert attacker.stdin is not None
    attacker.stdin.write(b"begin\n")
    attacker.stdin.flush()


def end(attacker: subprocess.Popen[bytes]) -> str:
    """End an attacker; return its number of subscribers and its messages per second."""
    attacker.send_signal(signal.SIGCONT)
    sent, _ = attacker.communicate(b"end\n", timeout=10.0)
    return " x ".join(sent.decode().split())


def freeze() -> None:
    """Subscribe to the topics of the flight, and stop without closing the connections."""
    sys.stdin.readline()
    rospy.init_node("frozen_listener")
    for topic, kind in (
        ("/tf", TFMessage),
        ("/state", PositionVelocityYawStateStamped),
        ("/control/final", ControlStamped),
    ):
        rospy.Subscriber(topic, kind, lambda _: None)
    time.sleep(0.5)
    os.kill(os.getpid(), signal.SIGSTOP)
    os._exit(0)


if __name__ == "__main__":
    main()
