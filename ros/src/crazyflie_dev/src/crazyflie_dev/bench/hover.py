"""What a hover of the software example costs, and how late its controls come."""

import functools
import math
import tempfile
import time
from pathlib import Path

import numpy as np

from crazyflie_dev.bench import graph
from crazyflie_dev.bench.row import NotMeasuredError, Row
from crazyflie_utils.testing.launching import roslaunch

DURATION = 20.0  #: For how long a figure is measured, s.
_BEGINNING = 500_000_000  #: So long, ns, rates are not counted.

_NODES = (
    "/simulator",
    "/state_estimator",
    "/lqr_controller",
    "/takeoff_server",
    "/takeoff_control_filter",
)
_COMPOSED = ("/composed",)
_STATE = "crazyflie_msgs/PositionVelocityYawStateStamped"
_CONTROL = "crazyflie_msgs/ControlStamped"


_FIGURES = {
    "cpu": ("CPU of the graph", "% of a core"),
    "cpu_watched": ("the same with listeners outside", "% of a core"),
    "memory": ("memory (PSS)", "MiB"),
    "latency_p50": ("state to final control, outside, p50", "ms"),
    "latency_p99": ("state to final control, outside, p99", "ms"),
    "tf_rate": ("rate of /tf", "Hz"),
    "pose_p50": ("stamp of the pose to final control, p50", "ms"),
}


def _rows(name, words, nodes, arguments, most):
    """Return the rows of one arrangement of nodes; ``most`` has goals, figure -> number."""
    measure = functools.cache(functools.partial(_fly, nodes, arguments))

    def row(figure):
        text, unit = _FIGURES[figure]
        least, limit = (999.0, 1001.0) if figure == "tf_rate" else (-math.inf, most.get(figure))
        limit = math.inf if limit is None else limit
        return Row(
            f"{figure}_{name}", f"{text}, {words}", unit, lambda: measure()[figure], least, limit
        )

    return [row(figure) for figure in _FIGURES]


def _fly(nodes, arguments):
    """Return figure -> value of a hover."""
    with tempfile.TemporaryDirectory() as folder:
        launch = ["crazyflie_examples", "sw_hover.launch", "rviz:=false", *arguments]
        with roslaunch(launch, Path(folder) / "log"):
            graph.wait_for_service("/takeoff")
            graph.call("/takeoff")
            processes = [graph.process_of(node) for node in nodes]
            figures = {"cpu": _cpu_load(processes)}
            used, began = graph.cpu_time(processes), time.monotonic()
            arrivals = _listen(nodes)
            load = (graph.cpu_time(processes) - used) / (time.monotonic() - began)
            figures["cpu_watched"] = 100.0 * load
            figures["memory"] = graph.memory(processes)
    return figures | _latencies(arrivals) | {"tf_rate": _rate(arrivals, "/tf")}


def _cpu_load(processes):
    used, began = graph.cpu_time(processes), time.monotonic()
    time.sleep(DURATION)
    return 100.0 * (graph.cpu_time(processes) - used) / (time.monotonic() - began)


def _listen(nodes):
    # In one process all of them are the same node.
    simulator, estimator, *_, control_filter = nodes if len(nodes) > 1 else 3 * nodes
    return graph.listen(
        DURATION,
        (simulator, "/tf", "tf2_msgs/TFMessage"),
        (estimator, "/state", _STATE),
        (control_filter, "/control/final", _CONTROL),
    )


def _rate(arrivals, topic):
    times = [arrival for name, arrival, _ in arrivals if name == topic]
    # What came while the listener was still connecting to other topics waited for it.
    times = [each for each in times if each > times[0] + _BEGINNING]
    if len(times) < 2:
        raise NotMeasuredError(f"nothing came on {topic}")
    return 1e9 * (len(times) - 1) / (times[-1] - times[0])


def _latencies(arrivals):
    states = {stamp: arrival for name, arrival, stamp in arrivals if name == "/state"}
    controls = [each[1:] for each in arrivals if each[0] == "/control/final"]
    # The filter passes a control on with its stamp, which is that of the pose.
    answers = [(arrival, stamp) for arrival, stamp in controls if stamp in states]
    if not answers:
        raise NotMeasuredError("no control was made from a state; does the vehicle fly?")
    latency = [(arrival - states[stamp]) * 1e-6 for arrival, stamp in answers]
    age = [(arrival - stamp) * 1e-6 for arrival, stamp in answers]
    return {
        "latency_p50": float(np.percentile(latency, 50)),
        "latency_p99": float(np.percentile(latency, 99)),
        "pose_p50": float(np.percentile(age, 50)),
    }


ROWS = [
    *_rows("separate", "five processes", _NODES, [], {"cpu": 22.0, "memory": 190.0}),
    *_rows(
        "composed",
        "one process",
        _COMPOSED,
        ["composed:=true"],
        {"cpu": 7.0, "memory": 50.0, "latency_p50": 0.15, "latency_p99": 0.4},
    ),
    *_rows(
        "arrival",
        "one process, on arrival",
        _COMPOSED,
        ["composed:=true", "act_on_arrival:=true"],
        {"pose_p50": 1.0},
    ),
]
