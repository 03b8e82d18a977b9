#!/usr/bin/env python
"""How the hover stack bears hostile messages: rates of the control, and memory of the nodes.

Start `roslaunch crazyflie_examples sw_hover.launch rviz:=false` in one shell and this in
another; it prints a line for each attack. Nothing is asserted: the figures depend on the
machine, of which the attacker takes a core.
"""

import os
import re
import subprocess
import sys
import time

import rospy
from geometry_msgs.msg import TransformStamped
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import ControlStamped, PositionVelocityStateStamped

_DURATION = 10.0
_NODES = ("state_estimator", "lqr_controller", "takeoff_control_filter", "takeoff_server")


def main() -> None:
    """Attack, one way after the other."""
    if len(sys.argv) > 1:
        attack(sys.argv[1])
    rospy.init_node("victim_watch")
    controls = []
    rospy.Subscriber("/control/lqr", ControlStamped, lambda _: controls.append(1), tcp_nodelay=True)
    # The controller is silent without a reference.
    reference = rospy.Publisher("/ref", PositionVelocityStateStamped, latch=True, queue_size=1)
    reference.publish(PositionVelocityStateStamped())
    time.sleep(3.0)
    print(f"{'attack':<16}{'control, Hz':>12}{'   memory of ' + ', '.join(_NODES) + ', MB'}")
    for kind in ("none", "junk", "reference", "empty_frames", "tf"):
        attacker = subprocess.Popen([sys.executable, __file__, kind])
        time.sleep(3.0)
        del controls[:]
        before = memory()
        time.sleep(_DURATION)
        rate = len(controls) / _DURATION
        growth = ", ".join(f"{b} -> {a}" for b, a in zip(before, memory(), strict=True))
        attacker.kill()
        attacker.wait(10.0)
        print(f"{kind:<16}{rate:>12.1f}   {growth}", flush=True)


def attack(kind: str) -> None:
    """Send what one attack sends until it is ended."""
    rospy.init_node(f"attacker_{kind}")
    publishers = {
        "junk": ("/in_flight_state", String, 10_000.0),
        "reference": ("/ref", PositionVelocityStateStamped, 10_000.0),
        "empty_frames": ("/tf", TFMessage, 1000.0),
        "tf": ("/tf", TFMessage, 20e6 / 8000.0),
    }
    if kind not in publishers:
        time.sleep(3600.0)
    topic, message_type, rate = publishers[kind]
    publisher = rospy.Publisher(topic, message_type, queue_size=10)
    message = message_type()
    if kind == "junk":
        message.data = "junk"
    if kind == "empty_frames":
        message.transforms = [TransformStamped()]
    count, start = 0, time.monotonic()
    while not rospy.is_shutdown():
        if kind == "tf":
            message.transforms = [transform(k) for k in range(80)]
        publisher.publish(message)
        count += 1
        time.sleep(max(0.0, start + count / rate - time.monotonic()))


def transform(number: int) -> TransformStamped:
    """Return a transform of some other body, about 100 bytes."""
    message = TransformStamped(child_frame_id=f"body{number:03d}")
    message.header.frame_id = "world"
    message.header.stamp = rospy.Time.now()
    message.transform.rotation.w = 1.0
    return message


def memory() -> list[int]:
    """Return the resident memory of the nodes, MB."""
    found = []
    for name in _NODES:
        for process in filter(str.isdigit, os.listdir("/proc")):
            try:
                with open(f"/proc/{process}/cmdline", encoding="utf-8") as file:
                    command = file.read()
                if f"__name:={name}" in command and "python" in command:
                    with open(f"/proc/{process}/status", encoding="utf-8") as file:
                        size = re.search(r"VmRSS:\s+(\d+)", file.read())
                    found.append(int(size[1]) // 1024)
                    break
            except OSError:
                continue
    return found


if __name__ == "__main__":
    main()
