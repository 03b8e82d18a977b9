"""The page of a report, in Chromium."""

import colorsys
import contextlib
import json
import time

import bags
import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

from crazyflie_reports.bag_report import make

LONGEST_WAIT = 60.0  #: s, for what a loaded machine does in one.
SMALLEST_VEHICLE = 40.0  #: px, from one propeller to the opposite one.


@contextlib.contextmanager
def chromium(width):
    """Yield a headless Chromium that reaches nothing but files."""
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in ("--headless=new", "--no-sandbox", f"--window-size={width},1000"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    browser = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    try:
        yield browser
    finally:
        browser.quit()


@pytest.fixture(scope="module")
def wide():
    """Return a browser that shows two plots side by side."""
    with chromium(1200) as browser:
        yield browser


@pytest.fixture(scope="module")
def narrow():
    """Return a browser in which a legend has more than one line."""
    with chromium(600) as browser:
        yield browser


def open_report(browser, folder, bag, moment=5.0, *others, **options):
    """Show the report of a bag, and of additional ones, at a time of its replay (s)."""
    make([bag, *others], folder / "out", **options)
    browser.get_log("browser")
    browser.get("about:blank")
    browser.get_log("performance")
    browser.get(f"{(folder / 'out' / 'report.html').as_uri()}#{moment}")
    end = time.monotonic() + LONGEST_WAIT
    while browser.execute_script("return document.readyState") != "complete":
        assert time.monotonic() < end
        time.sleep(0.05)
    assert browser.get_log("browser") == []


def tell(browser, script):
    """Return the value of an expression on the page; `column` is its first one."""
    return browser.execute_script(f"const column = columns[0]; return {script};")


def test_nothing_is_loaded_but_the_file(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag"))
    events = [json.loads(each["message"])["message"] for each in wide.get_log("performance")]
    requests = [each["params"] for each in events if each["method"] == "Network.requestWillBeSent"]
    page = (tmp_path / "out" / "report.html").as_uri()
    assert {each["request"]["url"].partition("#")[0] for each in requests} == {page}


def test_a_legend_is_seen_with_the_names_of_all_curves(narrow, tmp_path):
    open_report(narrow, tmp_path, bags.flight_bag(tmp_path / "a.bag", tilt=0.1))
    names = tell(narrow, "column.plots.map(p => p.data.curves.map(c => c.name))")
    seen = tell(
        narrow,
        """column.plots.map(p => {
          const box = p.parent.getBoundingClientRect();
          return [...p.parent.querySelectorAll(".u-label")].filter(label => {
            const { left, right, top, bottom, width } = label.getBoundingClientRect();
            return width > 0 && left >= box.left && right <= box.right && top >= box.top
              && bottom <= box.bottom && right <= innerWidth;
          }).map(label => label.textContent);
        })""",
    )
    assert [each[1:] for each in seen] == names
    assert ["x", "y", "z", "x reference", "y reference", "z reference"] in names


def test_no_curve_is_red_and_what_is_not_normal_has_a_mark_too(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag", tilt=0.2618))
    for color in tell(wide, "COLORS"):
        hue, _, saturation = colorsys.rgb_to_hsv(*(int(color[k : k + 2], 16) for k in (1, 3, 5)))
        assert 30.0 < 360.0 * hue < 330.0 or saturation < 0.5, color
    marks = tell(
        wide,
        """[...document.querySelectorAll("#figures .abnormal")].map(
          cell => getComputedStyle(cell, "::before").content)""",
    )
    assert len(marks) >= 2
    assert set(marks) == {'"! "'}
    assert "“!”: not normal" in wide.page_source


def test_the_vehicle_is_large_enough_to_be_seen(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag"))
    assert tell(wide, "2 * column.replay.arm * column.replay.scale") >= SMALLEST_VEHICLE


def test_no_slot_between_the_plots_is_empty(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag"))
    lefts, rights = (
        tell(wide, f"column.plots.map(p => Math.round(p.parent.getBoundingClientRect().{side}))")
        for side in ("left", "right")
    )
    assert len(lefts) == 5
    assert lefts[0] < lefts[1] == lefts[3]
    assert (lefts[4], rights[4]) == (lefts[0], rights[1])


def test_what_is_not_known_and_what_is_at_its_limit_is_explained(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag", tilt=0.2618))
    cells = tell(
        wide,
        """[...document.querySelectorAll("#figures tr")].map(
          row => [...row.cells].map(cell => cell.textContent))""",
    )
    rows = {row[0]: row for row in cells}
    assert rows["tilt commanded, maximum"][2:] == [
        "15", "≤ 15 deg, the limit to which every control is cut",
    ]  # fmt: skip
    assert rows["battery, lowest"][2:] == ["–", "not known: it needs battery voltages"]
    assert all("it needs" in row[3] for row in cells if row[2] == "–")
    assert "“–”: not known" in wide.page_source


def test_the_replay_does_not_fly_through_a_gap(wide, tmp_path):
    # 1 s of the replay is 2 s of the bag.
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag", gap=(2.0, 6.0)), 3.0)
    pose = "column.replay.said"
    assert tell(wide, pose) == "no state for 2.0 s; the last one: x 0.00  y 0.00  z 0.50 m"
    wide.execute_script("seek(6)")
    assert tell(wide, pose) == "x 0.00  y 0.00  z 1.00 m"
    wide.execute_script("seek(0.5)")
    assert tell(wide, pose) == "x 0.00  y 0.00  z 0.25 m"


def test_no_line_is_drawn_in_a_gap(wide, tmp_path):
    # Controls come 5 ms later than states, in the same plot.
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag", gap=(2.0, 6.0)))
    unknown = tell(
        wide,
        """column.plots.map(p => p.uplot.data.slice(1).map((values, k) => {
          const times = p.uplot.data[0], inside = (_, i) => times[i] > 1.02 && times[i] < 4.98;
          return [p.data.curves[k].name, values.filter(inside).every(v => v === null)];
        }))""",
    )
    found = dict(each for plot in unknown for each in plot)
    assert found == {name: not name.endswith("reference") for name in found}
    assert {"z", "z reference", "yaw", "roll commanded", "thrust", "distance"} <= set(found)


def test_a_flight_with_one_state_is_drawn(wide, tmp_path):
    with bags.written(tmp_path / "a.bag") as bag:
        for k in range(3):
            control = bags.ControlStamped(bags.header(k), bags.Control(thrust=9.81))
            bag.write("/control/final", control, bags.stamp(k))
        state = bags.PositionVelocityYawState(z=0.5)
        message = bags.PositionVelocityYawStateStamped(header=bags.header(1.0), state=state)
        bag.write("/state", message, bags.stamp(1.0))
        bag.write("/in_flight", bags.Empty(), bags.stamp(0.5))
    open_report(wide, tmp_path, tmp_path / "a.bag", 1.0)
    assert tell(wide, "column.replay.said") == "x 0.00  y 0.00  z 0.50 m"


def test_the_legend_shows_the_values_of_the_time_of_the_replay(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag"), 1.0)
    values = """[...column.plots[0].parent.querySelectorAll(".u-value")].map(v => v.textContent)"""
    assert tell(wide, values)[0:4:3] == ["1.00 s", "0.50"]
    wide.execute_script("seek(5)")
    assert tell(wide, values)[3] == "1.00"
    # A reference is valid until the next one.
    assert tell(wide, values)[6] == "1.00"


def test_the_line_of_the_moment_is_there_when_the_page_is(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag"))
    place = "Number.parseFloat(column.plots[0].line.style.left)"
    end = time.monotonic() + LONGEST_WAIT
    while tell(wide, place) is None:
        assert time.monotonic() < end
        time.sleep(0.05)
    assert tell(wide, place) == pytest.approx(tell(wide, "column.plots[0].uplot.valToPos(5, 'x')"))


def test_flights_of_two_recordings_are_laid_over_each_other(wide, tmp_path):
    first = bags.flight_bag(tmp_path / "a.bag")
    second = bags.flight_bag(tmp_path / "b.bag")
    open_report(wide, tmp_path, first, 5.0, second, compares=True)
    for k, other in enumerate(("second", "first")):
        column = f"columns[{k}]"
        names = tell(wide, f"{column}.plots[0].data.curves.map((each) => each.name)")
        assert f"{names[0]} {other}" in names
        # Grey in the replay, from the same moment on.
        assert tell(wide, f"{column}.replay.others.map((each) => each.vehicle)") == [other]
        assert tell(wide, f"{column}.replay.others[0].start - {column}.flight.start") == 0
    assert "the other flight" in tell(wide, "document.getElementById('summary').textContent")


def test_nothing_of_the_list_is_cut_off_where_two_recordings_share_the_width(wide, tmp_path):
    bags.flight_bag(tmp_path / "b.bag")
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag"), 5.0, tmp_path / "b.bag")
    lists = """columns.map(each => each.section.querySelector(".scroll"))
      .map(each => each.scrollWidth - each.clientWidth)"""
    assert tell(wide, lists) == [0, 0]


def test_values_that_are_all_zero_have_an_axis_around_zero(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag"))
    low, high = tell(
        wide,
        """(({ min, max }) => [min, max])(
          column.plots.find(p => p.data.title === "attitude").uplot.scales.y)""",
    )
    assert -0.1 < low < 0.0 < high < 0.1


def test_plots_of_a_column_show_the_same_part_of_time(wide, tmp_path):
    open_report(wide, tmp_path, bags.flight_bag(tmp_path / "a.bag"))
    wide.execute_script("columns[0].plots[0].zoom(2, 4)")
    scales = "column.plots.map(p => [p.uplot.scales.x.min, p.uplot.scales.x.max])"
    assert tell(wide, scales) == [[2, 4]] * 5
    wide.execute_script("columns[0].plots[1].zoom(-99, 99)")
    assert tell(wide, scales) == [[-1, 13]] * 5
