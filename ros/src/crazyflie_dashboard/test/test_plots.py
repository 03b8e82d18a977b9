"""Plots: the last minute, and any number of any topic."""

import itertools
import math
import threading
from pathlib import Path

import pytest
import roslib.packages
from geometry_msgs.msg import Point, Pose, PoseStamped

from crazyflie_dashboard.page.plots_panel import AXES, COLORS, chart, lines
from crazyflie_dashboard.page_data import Series
from crazyflie_dashboard.plots import (
    Ring,
    VehiclePlots,
    fields_of,
    number_in,
)
from crazyflie_dashboard.snapshot import VehicleSnapshot

EMPTY = Series("/cf1/ref/state/z", "", (), ())
SERIES = (EMPTY, Series("/cf1/state/state/z", "", (-1.0, 0.0), (0.5, 0.6)))


def test_a_plot_has_twenty_numbers_a_second_of_the_last_minute():
    ring = Ring("m")
    for k in range(10000):
        ring.add(0.01 * k, float(k))
    series = ring.series("x", 100.0)
    assert series.times[-1] == pytest.approx(-0.01, abs=0.05)
    assert -60.0 <= series.times[0] < -59.0
    assert 1150 <= len(series.times) == len(series.values) <= 1200
    assert Ring("m").series("x", 0.0).times == ()


def test_the_error_is_the_distance_from_the_reference():
    plots = VehiclePlots(lambda: 5.0)
    plots.take("reference", (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, math.nan))
    plots.take("state", (0.3, 0.4, 1.0, 0.0, 0.0, 0.0, 0.0))
    plots.take("final_control", (0.0, 0.0, 0.0, 9.81))
    plots.take("log pm", [3.9, 0.5])
    assert [series.unit for series in plots.series()] == [*"mmmmm", *["m/s"] * 3, "m/s^2", "", ""]
    values = {series.name: (series.values[-1], series.unit) for series in plots.series()}
    assert values["error"] == (pytest.approx(0.5), "m")
    assert values["thrust"] == (pytest.approx(9.81), "m/s^2")
    assert values["pm[1]"] == (0.5, "")


def test_attitudes_are_in_degrees_and_positions_of_poses_without_states():
    plots = VehiclePlots(lambda: 5.0)
    half = math.radians(45.0) / 2.0
    now = VehicleSnapshot(
        "cf1", position=(1.0, 2.0, 3.0), rotation=(0.0, 0.0, math.sin(half), math.cos(half))
    )
    plots.take_pose(now, has_state=False)
    values = {series.name: series.values[-1] for series in plots.series()}
    assert values["yaw"] == pytest.approx(45.0)
    assert values["position z"] == 3.0


def test_numbers_are_found_in_messages():
    message = PoseStamped(pose=Pose(position=Point(1.0, 2.0, 3.0)))
    assert number_in(message, "pose/position/y") == 2.0
    assert number_in(message, "header/stamp") == 0.0


def test_plots_are_read_while_numbers_come():
    ring, is_over = Ring("m"), threading.Event()

    def take():
        for k in itertools.count():
            ring.add(k, 0.0)
            if is_over.is_set():
                return

    source = threading.Thread(target=take)
    source.start()
    try:
        for _ in range(2000):
            ring.series("x", 0.0)
    finally:
        is_over.set()
        source.join()


def test_a_field_without_a_message_says_so():
    found = {"": SERIES, "cf1": ()}
    rows = lines(["cf1"], found, ["ref/state/z", "state/state/z"])
    empty, _ = chart(rows, can_be_measured=False)["title"]
    assert "ref/state/z: no message yet" in empty["text"]
    assert [row.color for row in rows] == [AXES["z"], AXES["z"]]


def test_several_vehicles_are_laid_over_each_other_by_field():
    def of(name):
        return tuple(Series(f"position {axis}", "m", (-1.0, 0.0), (0.5, 0.6)) for axis in "xz")

    ticked = ["position z", "position x", "roll"]
    rows = lines(["cf1", "cf2"], {name: of(name) for name in ("cf1", "cf2")}, ticked)
    assert [(row.plot, row.series.name) for row in rows] == [
        (("position z",), "cf1"),
        (("position z",), "cf2"),
        (("position x",), "cf1"),
        (("position x",), "cf2"),
    ]
    assert rows[0].color == rows[2].color != rows[1].color == rows[3].color
    (row,) = lines(["cf1"], {"cf1": of("cf1")}, ["position x"])
    assert (row.plot, row.color) == (("m",), AXES["x"])


def test_numbers_of_a_type_are_offered_as_paths():
    assert "pose/orientation/w" in fields_of("geometry_msgs/PoseStamped")
    assert "header/stamp" in fields_of("sensor_msgs/Imu")
    assert not any("covariance" in each for each in fields_of("sensor_msgs/Imu"))
    assert fields_of("unknown_msgs/Unknown") == ()


def test_x_y_and_z_have_one_color_in_plots_scene_and_report():
    def text(package, path):
        return (Path(roslib.packages.get_pkg_dir(package)) / path).read_text()

    quoted = ", ".join(f'"{color}"' for color in AXES.values())
    scene = "src/crazyflie_dashboard/page/objects/vehicles.js"
    assert f"AXES = [{quoted}]" in text("crazyflie_dashboard", scene)
    assert f"COLORS = [{quoted}, " in text("crazyflie_reports", "page/plots.js")


def test_colors_of_vehicles_can_be_read_on_a_light_page_and_on_a_dark_one():
    def luminance(color):
        shares = (int(color[k : k + 2], 16) / 255 for k in (1, 3, 5))
        linear = [c / 12.92 if c < 0.04 else ((c + 0.055) / 1.055) ** 2.4 for c in shares]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    # The ratio of contrast that WCAG asks of graphics is 3.
    low, high = 3 * (luminance("#1a2029") + 0.05), (luminance("#ffffff") + 0.05) / 3
    assert all(low < luminance(color) + 0.05 < high for color in COLORS)
