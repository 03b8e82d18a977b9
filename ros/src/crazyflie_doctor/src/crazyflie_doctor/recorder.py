"""Records tf, controls, clock and diagnostics of a running graph."""

import os
import time

from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from crazyflie_doctor.graph import Graph
from crazyflie_doctor.timing import Recording, Transform
from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils.main import begin


def record(graph: Graph, duration: float) -> Recording:
    """Return what is published within ``duration`` seconds of the machine's clock.

    The node publishes nothing, and subscribes to topics of the graph that have a publisher.
    """
    process = begin(f"doctor_{os.getpid()}")
    handle = process.handle(f"/doctor_{os.getpid()}")
    recording = Recording()

    def now():
        return handle.stamp().to_sec()

    def on_transforms(message, is_static):
        source = message._connection_header["callerid"]
        for transform in message.transforms:
            recording.transforms.append(
                Transform(
                    transform.header.frame_id.strip("/"),
                    transform.child_frame_id.strip("/"),
                    source,
                    transform.header.stamp.to_sec(),
                    now(),
                    is_static,
                )
            )

    def on_control(topic, message):
        stamp = message.header.stamp.to_sec()
        # A control without a stamp does not say how old the pose is.
        if stamp > 0.0:
            recording.delays.setdefault(topic, []).append(now() - stamp)
            recording.control_stamps.setdefault(topic, []).append(stamp)

    def on_diagnostics(message):
        source = message._connection_header["callerid"]
        for status in message.status:
            if "://" in status.hardware_id:
                recording.reported.setdefault(status.hardware_id, set()).add(source)

    def subscribe(topic, message_type, callback):
        if graph.publishers.get(topic):
            handle.subscribe(topic, message_type, callback)

    subscribe("/tf", TFMessage, lambda message: on_transforms(message, False))
    subscribe("/tf_static", TFMessage, lambda message: on_transforms(message, True))
    subscribe("/clock", Clock, lambda message: recording.clocks.append(message.clock.to_sec()))
    subscribe("/diagnostics", DiagnosticArray, on_diagnostics)
    for topic in sorted({t for (_, t), (name, _) in graph.topic_types.items() if name == _CONTROL}):
        subscribe(topic, ControlStamped, lambda message, topic=topic: on_control(topic, message))
    process.start()
    time.sleep(duration)
    process.stop()
    handle.close()
    return recording


_CONTROL = "crazyflie_msgs/ControlStamped"
