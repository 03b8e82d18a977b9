"""The page in headless Chromium, with vehicles that are only numbers."""

import itertools
import math
import re
import threading
import time
import urllib.request
from concurrent.futures import Future
from dataclasses import replace

import cv2
import numpy as np
import pytest
from fake_dashboard import ACTIONS, FakeDashboard, vehicle
from geometry_msgs.msg import Point, Vector3
from pages import wait_for
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from crazyflie_dashboard.history import History
from crazyflie_dashboard.snapshot import Action, LogLine, Placed, Sentence, Step
from crazyflie_dashboard.surroundings import grouped
from crazyflie_takeoff.envelope import Box


def test_vehicles_take_off_go_where_the_floor_is_clicked_and_land(browser, server):
    browser.take_control()
    browser.choose("cf1", "cf2")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))
    browser.click_floor(0.5, -0.5)
    browser.press("Go")
    wait_for(lambda: len(server.dashboard.commands) == 2, "one command for both")
    # Their middle goes where the click was, at the height of the takeoff.
    assert server.dashboard.commands[1].goal == pytest.approx((0.5, -0.5, 1.0), abs=0.02)
    browser.press("Land")
    browser.has("on the ground", browser.card("cf1"))
    assert server.actions() == [
        (Action.TAKEOFF, ("cf1", "cf2")),
        (Action.GO_TO, ("cf1", "cf2")),
        (Action.LAND, ("cf1", "cf2")),
    ]


def test_the_handle_of_a_goal_is_dragged_and_has_height_and_yaw(browser, server):
    browser.take_control()
    browser.choose("cf1")
    browser.press("Take off")
    browser.click_floor(0.5, -0.5)
    # With the click comes a height into the empty field.
    wait_for(lambda: browser.in_scene("goal.visible"), "the goal")
    for label, text in (("z, m", "1.3"), ("yaw, °", "90")):
        browser.enter(f'input[aria-label="{label}"]', text)
    wait_for(lambda: browser.in_scene("goal.height") == 1.3, "the handle at its height")
    browser.drag_scene((0.5, -0.5, 1.3), (-0.3, -0.2, 1.3))
    wait_for(
        lambda: browser.find('input[aria-label="x, m"]').get_attribute("value")[:2] == "-0", "x"
    )
    browser.press("Go")
    wait_for(lambda: len(server.dashboard.commands) == 2, "a command")
    command = server.dashboard.commands[1]
    assert command.goal == pytest.approx((-0.3, -0.2, 1.3), abs=0.02)
    assert command.yaw == pytest.approx(math.pi / 2)


def test_the_image_of_a_camera_appears_and_is_renewed(browser, server):
    def picture(width):
        return cv2.imencode(".jpg", np.full((48, width, 3), 128, np.uint8))[1].tobytes()

    browser.tab("Cameras")
    browser.select("topic", "/cf1/image_raw")
    for width in (64, 80):
        server.dashboard.picture = picture(width)
        image = (
            "const i = document.querySelector('.camera');"
            f"return i?.naturalWidth === {width} && i.src"
        )
        source = wait_for(lambda image=image: browser.driver.execute_script(image), "a picture")
    # As bytes, and not as text within a message of the page.
    with urllib.request.urlopen(source) as answer:
        assert answer.read() == server.dashboard.picture
    server.dashboard.picture = "its encoding is yuv422"
    browser.has("its encoding is yuv422", ".panels")


def test_a_stale_vehicle_says_how_old_its_pose_is(browser):
    browser.has("3 vehicles")
    browser.has("cf3 · 7 s old", ".scene")
    browser.has("7.4 s ago", browser.card("cf3"))
    assert "stale" in browser.find(browser.card("cf3")).get_attribute("class")
    assert "stale" not in browser.find(browser.card("cf1")).get_attribute("class")


def test_the_bar_says_that_the_scene_is_not_what_it_was(browser, server):
    browser.has("3 vehicles", ".summary")
    sentence = Sentence("error", "dashboard", "no graph: the master does not answer")
    server.dashboard.set_vehicles(vehicle("cf1", 0.0), sentences=(sentence,))
    browser.has("no graph: the master does not answer", ".summary.bad")


def test_a_scene_that_is_not_renewed_is_shown_as_old(browser, server):
    browser.has("3 vehicles", ".summary")
    server.dashboard.set_vehicles(vehicle("cf1", 0.0), made=time.monotonic() - 5.0)
    browser.has("the dashboard is held up", ".summary.bad")
    # The pose, too, is as old as what is shown.
    wait_for(lambda: re.search(r"cf1 · ([5-9]|\d\d) s old", browser.text(".scene")), "its age")
    stale = "vehicles.poses.every((pose) => pose[7] === 2)"
    wait_for(lambda: browser.in_scene(stale), "a vehicle that is drawn as stale")


def test_a_server_that_sends_nothing_is_reported_by_the_page_itself(browser, driver):
    driver.execute_script("window.setBeat = () => {}")
    wait_for(lambda: browser.find("body.old"), "a page that says that it is old")
    assert "nothing comes from the dashboard" in browser.find("body").get_attribute("data-age")


def acts(browser, name):
    return browser.find(f"{browser.card(name)} .acts").text.split("\n")


def test_cards_offer_what_can_be_done_now_and_say_what_comes_next(browser, server):
    browser.has("3 vehicles")
    assert acts(browser, "cf1") == ["take off", "emergency"]
    server.dashboard.change("cf1", is_in_flight=True, state="hovering")
    browser.has("hovering", browser.card("cf1"))
    assert acts(browser, "cf1") == ["land", "hold", "emergency"]
    browser.choose("cf1")
    wait_for(lambda: not browser.button("Take off").is_enabled(), "no takeoff in flight")
    server.dashboard.change("cf1", is_in_flight=False, is_emergency=True, state="emergency")
    browser.has("to fly again, press reset first", browser.card("cf1"))
    assert acts(browser, "cf1") == ["reset", "emergency"]
    assert not browser.button("Take off").is_enabled()
    server.dashboard.change("cf1", is_emergency=False, is_held=True, is_in_flight=True)
    browser.has("held by the fleet: too near to another vehicle", browser.card("cf1"))
    browser.has("cf1 · held", ".scene")


def test_the_goal_goes_when_it_is_reached(browser, server):
    browser.take_control()
    browser.choose("cf1")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))
    browser.click_floor(0.5, -0.5)
    wait_for(lambda: browser.in_scene("goal.visible"), "the goal")
    browser.press("Go")
    wait_for(lambda: not browser.in_scene("goal.visible"), "no goal")


def test_a_goal_that_is_set_meanwhile_stays(browser, server):
    server.dashboard.is_slow = True
    server.dashboard.change("cf1", position=(-1.0, 0.0, 1.0), is_in_flight=True, state="flying")
    browser.take_control()
    browser.choose("cf1")
    browser.click_floor(0.5, -0.5)
    browser.press("Go")
    wait_for(lambda: server.dashboard.commands, "a command")
    browser.enter('input[aria-label="y, m"]', "0.7")
    wait_for(lambda: browser.in_scene("goal.position.y") == 0.7, "the new goal")
    server.dashboard.change("cf1", position=server.dashboard.commands[0].goal)
    browser.has("done", ".strips")
    assert browser.in_scene("goal.visible")
    assert browser.find('input[aria-label="y, m"]').get_attribute("value") == "0.7"


def test_identical_texts_are_one_line_and_commands_are_not(browser, server, driver):
    texts = [
        *40 * ["cf1 and cf2 are 0.30 m apart"],
        *2 * ["page 1: go to cf1 to (0.51, -0.49, 1.00) m"],
        "page 1: go to cf1 to (0.52, -0.49, 1.00) m",
    ]
    log = tuple(LogLine(k, 12.0 + k, "warn", "/fleet", text) for k, text in enumerate(texts))
    server.dashboard.set_vehicles(vehicle("cf1", 0.0), log=log, sentences=())
    browser.tab("Messages")
    browser.has("warn 51.0 s /fleet, 40 times since 12.0 s")
    assert browser.count(".line") == 4
    driver.execute_script(
        "window.kept = null; const make = URL.createObjectURL;"
        "URL.createObjectURL = (blob) => { blob.text().then((t) => kept = t); return make(blob); }"
    )
    browser.press("Export")
    kept = wait_for(lambda: driver.execute_script("return window.kept"), "the history")
    assert kept.splitlines()[0] == "time, s\tlevel\tnode\ttext"
    assert len(kept.splitlines()) == 1 + len(texts)


def test_all_vehicles_are_in_a_window_that_is_small(browser, driver, server):
    size = driver.get_window_size()
    driver.set_window_size(900, 700)
    try:
        server.dashboard.set_vehicles(*(vehicle(f"cf{k}", 1.0 * k, z=1.0) for k in range(5)))
        browser.has("5 vehicles")

        def is_seen(k):
            left, top, right, bottom = driver.execute_script(
                "const r = document.querySelector('.scene').getBoundingClientRect();"
                "return [r.left, r.top, r.right, r.bottom]"
            )
            x, y = browser.in_scene(f"screen({k}, 0, 1)")
            return left < x < right and top < y < bottom

        # It shows the vehicles that the scene has by then.
        browser.command("Overview", lambda: all(map(is_seen, range(5))), "all in the window")
    finally:
        driver.set_window_size(size["width"], size["height"])


def test_a_vehicle_that_is_clicked_in_the_scene_is_chosen(browser):
    browser.has("0 of 3 selected")
    browser.click_scene(-1.0, 0.0, 0.01)
    browser.has("1 of 3 selected")
    assert browser.find(f"{browser.card('cf1')}.chosen")


def test_the_key_of_the_emergency_works_without_control(browser, server):
    server.dashboard.change("cf1", is_in_flight=True, position=(-1.0, 0.0, 1.0))
    browser.type(Keys.ESCAPE, Keys.ESCAPE)
    browser.has("emergency", browser.card("cf1") + " .state")
    browser.has("Emergency: all have answered", ".emergency-report")
    assert server.dashboard.emergencies == [None]


def test_the_emergency_says_what_has_failed_and_is_for_one_vehicle_on_its_card(browser, server):
    server.dashboard.refusals["cf2"] = "it has not answered within 5 s"
    browser.has("3 vehicles")
    wait_for(
        lambda: browser.find(f"{browser.card('cf2')} button.emergency").click() or True,
        "its button",
    )
    browser.has("cf2: it has not answered within 5 s", ".emergency-report")
    assert server.dashboard.emergencies == [("cf2",)]


def test_the_emergency_counts_without_a_vehicle_on_the_page(browser, server):
    server.dashboard.set_vehicles()
    browser.has("0 vehicles")
    browser.press("Emergency")
    browser.has("Emergency: all have answered", ".emergency-report")
    assert server.dashboard.emergencies == [None]


def test_the_emergency_counts_in_a_page_that_has_no_connection_yet(browser, server, driver):
    # As in a page that has just been loaded, and in one that has lost its connection.
    driver.execute_script("window.socket.io.reconnection(false); window.socket.disconnect()")
    wait_for(lambda: server.dashboard.pages.pages == (), "a page that is lost")
    browser.type(Keys.ESCAPE, Keys.ESCAPE)
    wait_for(lambda: server.dashboard.emergencies == [None], "the emergency")


def test_one_escape_is_no_emergency(browser, server):
    browser.type(Keys.ESCAPE)
    browser.take_control()
    browser.choose("cf1")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))
    assert server.actions() == [(Action.TAKEOFF, ("cf1",))]
    assert server.dashboard.emergencies == []


def test_boxes_show_what_is_chosen(browser):
    browser.has("0 of 3 selected")
    browser.press("All")
    browser.has("3 of 3 selected")
    browser.press("None")
    browser.choose("cf2")
    browser.has("1 of 3 selected")
    boxes = [browser.find(f"{browser.card(name)} input") for name in ("cf1", "cf2", "cf3")]
    wait_for(lambda: [each.is_selected() for each in boxes] == [False, True, False], "boxes")


def test_a_takeoff_without_a_height_is_not_sent(browser, server):
    browser.take_control()
    browser.choose("cf1")
    browser.find('input[aria-label="height, m"]').send_keys(Keys.CONTROL, "a", Keys.DELETE)
    wait_for(lambda: not browser.button("Take off").is_enabled(), "no takeoff")
    assert browser.button("Take off").get_attribute("title") == "type a height"
    browser.find(f"{browser.card('cf1')} button").click()
    browser.has("take off: type a height", ".q-notification")
    # Strips and the bar are below.
    assert browser.find(".q-notification").rect["y"] < 300
    assert server.dashboard.commands == []


def test_go_waits_for_a_goal(browser, server):
    server.dashboard.change("cf1", position=(-1.0, 0.0, 1.0), is_in_flight=True, state="flying")
    browser.take_control()
    browser.choose("cf1")
    why = "click on the floor, or type x, y and z"
    wait_for(lambda: browser.button("Go").get_attribute("title") == why, "the reason")
    browser.click_floor(0.5, -0.5)
    wait_for(lambda: browser.button("Go").is_enabled(), "Go")


def test_a_refusal_is_shown_in_the_words_of_the_service(browser, server):
    server.dashboard.refusals["cf2"] = "battery at 3.05 V; expected at least 3.20 V"
    browser.take_control()
    browser.choose("cf1", "cf2")
    browser.press("Take off")
    browser.has("cf2: battery at 3.05 V; expected at least 3.20 V")
    browser.has("hovering", browser.card("cf1"))


def test_texts_are_shown_as_text(browser, server):
    name = "<script>document.title='taken'</script><img src=x onerror=document.title='taken'>"
    server.dashboard.set_vehicles(vehicle(name, 0.0, state="<b>bold</b>", reason="<i>why</i>"))
    server.dashboard.refusals[name] = "<u>not now</u>"
    browser.take_control()
    browser.has(name, ".cards")
    browser.has(name, ".scene")
    browser.has("<b>bold</b>", ".cards")
    browser.press("All")
    browser.press("Take off")
    browser.has("<u>not now</u>")
    assert "taken" not in browser.driver.title


def test_parameters_right_and_wrong(browser, server):
    browser.tab("Parameters")
    browser.select("node or vehicle", "/cf1/controller")
    row = '.parameter[data-name="K/gain"]'
    browser.has("float · 1/s · 0 to 2 · gain of the height", row)
    # Typed text is sent on Enter, not when the field loses the focus.
    browser.enter(f"{row} input", "0.9")
    browser.find(".search input").click()
    browser.enter(f"{row} input", "0.75\n")
    browser.has("is 0.75 now", row)
    assert server.dashboard.typed == ["0.75"]
    browser.enter(f"{row} input", "7\n")
    browser.has("K/gain is 7; expected 0 to 2 1/s", row)
    browser.enter(f"{row} input", "much\n")
    browser.has("K/gain is 'much'; expected a number", row)
    assert server.dashboard.gain.value == 0.75
    browser.select("node or vehicle", "cf1")
    browser.has("300 of 300 parameters; the first 30 are shown")
    browser.enter(".search input", "value123")
    browser.has("1 of 300 parameters")


def test_a_mission_flies_after_its_dry_run_has_passed(browser, server):
    browser.take_control()
    browser.choose("cf1")
    browser.tab("Missions")
    browser.select("mission or trajectory", "eight.csv")
    browser.press("Dry run")
    browser.has("cf1 and cf2 come as near as 0.1 m at 3.2 s")
    assert not browser.button("Fly").is_enabled()
    browser.select("mission or trajectory", "square.py")
    browser.press("Dry run")
    browser.has("The dry run has passed: 12.0 s, all land")
    wait_for(lambda: browser.button("Fly").is_enabled(), "Fly can be pressed")
    browser.press("Fly")
    browser.has("fly square.py with cf1", ".strip.done")
    assert server.dashboard.flown == ["/missions/square.py"]


def test_the_path_of_a_dry_run_is_drawn_once_until_another_mission_is_chosen(browser):
    def wait_for_lines(count):
        lines = "surroundings.paths.children.length"
        wait_for(lambda: browser.in_scene(lines) == count, f"{count} lines")

    browser.take_control()
    browser.choose("cf1")
    browser.tab("Missions")
    browser.select("mission or trajectory", "square.py")
    browser.press("Dry run")
    browser.has("The dry run has passed: 12.0 s, all land")
    wait_for_lines(1)
    for _ in range(2):
        browser.open()
        browser.has("you have control", ".control")
        wait_for(lambda: browser.button("Fly").is_enabled(), "what has passed may fly")
        wait_for_lines(1)
    browser.select("mission or trajectory", "eight.csv")
    wait_for_lines(0)


def test_a_dry_run_that_ends_after_another_mission_was_chosen_is_not_shown(
    browser, server, monkeypatch
):
    begun, answer, dry_run = [], Future(), server.dashboard.dry_run
    monkeypatch.setattr(server.dashboard, "dry_run", lambda *asked: begun.append(asked) or answer)
    browser.take_control()
    browser.choose("cf1")
    browser.tab("Missions")
    browser.select("mission or trajectory", "square.py")
    browser.press("Dry run")
    wait_for(lambda: begun, "the beginning of the dry run")
    result = dry_run(*begun[0]).result()
    browser.select("mission or trajectory", "eight.csv")
    wait_for(lambda: not server.dashboard.scene().paths, "the choice")
    dry_run(*begun[0])
    answer.set_result(result)
    wait_for(lambda: not server.dashboard.scene().paths, "no paths")
    assert "has passed:" not in browser.text(".panels")


def test_messages_and_plots(browser):
    browser.tab("Messages")
    browser.has("cf2 has a weak link")
    browser.has("move the antenna")
    browser.has("<b>link</b> at 40 %")
    browser.choose_tab("Plots", "cf1")
    wait_for(lambda: browser.find(".chart canvas"), "plots")
    browser.press("Stop")
    browser.has("position z, m", ".q-table")
    browser.has("0.599", ".q-table")  # The height has risen by so much.


def tick(browser, label):
    node = f"//*[contains(@class,'q-tree__node-header')][.//*[text()='{label}']]"
    box = f"{node}//*[contains(@class,'q-checkbox')]"
    wait_for(lambda: browser.driver.find_element("xpath", box).click() or True, label)


def test_fields_of_topics_are_plotted_by_a_tree_and_kept_in_the_address(browser, server, driver):
    browser.choose_tab("Plots", "cf1", "cf2")
    browser.has("cf1, cf2", ".panels")
    wait_for(lambda: browser.find(".fields").click() or True, "the tree")
    tick(browser, "imu")
    expected = {f"/{name}/imu/{axis}" for name in ("cf1", "cf2") for axis in "xy"}
    wait_for(lambda: {*server.dashboard.fields_shown} == expected, "fields of both")
    wait_for(lambda: "imu%2Fx" in driver.current_url, "the layout in the address")
    driver.get(driver.current_url)
    wait_for(lambda: {*server.dashboard.fields_shown} >= expected, "fields of the layout")
    chart = "getElement(document.querySelector('.chart').id.slice(1))"
    titles = f"return {chart}.chart.getOption().title.map((each) => each.text)"
    wait_for(lambda: any("imu/x" in each for each in driver.execute_script(titles)), "its plot")


def test_plots_are_kept_as_pictures_and_numbers(browser, driver):
    browser.choose_tab("Plots", "cf1")
    wait_for(lambda: browser.find(".chart canvas"), "plots")
    driver.execute_script(
        "window.kept = []; const make = URL.createObjectURL;"
        "URL.createObjectURL = (b) => { b.text().then((t) => kept.push(t)); return make(b); };"
        "HTMLAnchorElement.prototype.click = function () {"
        " kept.push(this.download + this.href.slice(0, 22)); }"
    )
    for text, sign in (
        ("SVG", "<svg"),
        ("PNG", "plots.pngdata:image/png;base64"),
        ("CSV", "vehicle,field,unit"),
    ):
        browser.press(text)
        some = f"return kept.some((each) => each.startsWith({sign!r}))"
        wait_for(lambda some=some: driver.execute_script(some), text)
    rows = driver.execute_script("return kept.find((each) => each.startsWith('vehicle'))")
    assert rows.splitlines()[1].startswith("cf1,position z,m,-60")


def test_an_earlier_moment_is_shown_and_nothing_is_commanded_then(browser, server, driver):
    browser.take_control()
    browser.choose("cf1")
    server.dashboard.change("cf1", position=(-1.0, 0.0, 0.5), state="before")
    before = replace(server.dashboard.scene(), made=time.monotonic() - 50.0)
    server.dashboard.change("cf1", position=(-1.0, 0.0, 2.0), is_emergency=True, state="after")
    server.dashboard.history = History()
    server.dashboard.history.add(before)
    browser.has("after", browser.card("cf1"))
    wait_for(lambda: browser.count(".timebar i.error"), "the emergency on the bar")
    driver.execute_script(
        "const r = document.querySelector('.timebar input'); r.value = -30;"
        "r.dispatchEvent(new Event('input'))"
    )
    browser.has("s ago", ".timebar.past")
    browser.has("before", browser.card("cf1"))
    wait_for(lambda: browser.in_scene("vehicles.poses[0][2]") == 0.5, "its place then")
    assert "past" in browser.button("Take off").get_attribute("title")
    browser.press("Now")
    browser.has("after", browser.card("cf1"))
    wait_for(lambda: browser.in_scene("vehicles.poses[0][2]") == 2.0, "its place now")


def test_a_lost_link_is_marked(browser, server):
    server.dashboard.change("cf1", link_quality=0.0)
    browser.has("0%", f"{browser.card('cf1')} .warn")


def test_what_has_not_changed_is_not_sent_again(browser, driver):
    driver.execute_script("window.seen = []; socket.onAny((event) => seen.push(event))")
    # Each half a second the clock of clicks, and nothing else.
    last = "return window.seen.slice(-3).join() === Array(3).fill('run_javascript').join()"
    for tab in ("Vehicles", "Plots", "Missions", "Messages"):
        browser.tab(tab)
        driver.execute_script("window.seen = []")
        wait_for(lambda: driver.execute_script(last), f"nothing but the clock in {tab}")


def test_a_hundred_thousand_points_are_one_thing_in_the_scene(browser, server):
    browser.has("3 vehicles")
    cloud = Marker(type=Marker.POINTS, scale=Vector3(0.02, 0.02, 0.0))
    cloud.points = 100_000 * [Point(1.0, 0.5, 0.2)]
    cubes = Marker(type=Marker.CUBE_LIST, scale=Vector3(0.1, 0.2, 0.3), color=ColorRGBA(a=1.0))
    cubes.points = 1000 * [Point(0.5, 0.0, 0.0)]
    turned = (1.0, 0.0, 0.0), (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    solids = tuple(Placed(grouped([each])[0][0][1], *turned) for each in (cloud, cubes))
    fence = Placed(Box((-1.0, -1.0, 0.0), (2.0, 1.0, 1.0)), *turned)
    server.dashboard.set_vehicles(vehicle("cf1", 0.0), solids=solids, fences=(fence,))
    parts = "surroundings.solids.children"
    wait_for(lambda: browser.in_scene(f"{parts}.length") == 2, "two objects")
    assert browser.in_scene(f"{parts}[0].geometry.attributes.position.count") == 100_000
    assert browser.in_scene(f"{parts}[1].count") == 1000
    wait_for(lambda: browser.in_scene(f"{parts}[1].position.x") == 1.0, "their frame")
    frame = "surroundings.fences.children[0]"
    assert browser.in_scene(f"{frame}.position.toArray()") == pytest.approx([1.0, 0.0, 0.0])
    assert browser.in_scene(f"{frame}.quaternion.z") == pytest.approx(math.sqrt(0.5))
    drawn = "renderer.info.render.calls"
    assert browser.in_scene(drawn) < 40


NEXT_PICTURES = """
const done = arguments[0];
let left = 10;
const step = () => left-- ? requestAnimationFrame(step) : done();
requestAnimationFrame(step);
"""


def test_vehicles_that_hover_are_not_drawn_again_without_a_graphics_card(browser, driver):
    browser.take_control()
    browser.choose("cf1")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))

    def is_still():
        before = browser.in_scene("renderer.info.render.frame")
        driver.execute_async_script(NEXT_PICTURES)
        return browser.in_scene("renderer.info.render.frame") == before

    assert browser.in_scene("vehicles.isTurning")
    wait_for(is_still, "pictures that are not drawn")


BUSY = """
window.came = [];
socket.on("vehicles", () => came.push(performance.now()));
const end = performance.now() + 3000;
while (performance.now() < end);
"""


def test_a_browser_that_was_busy_is_sent_the_newest_scene_and_not_all_that_it_has_missed(
    browser, server, driver
):
    is_over = threading.Event()

    def fly():
        for k in itertools.count():
            server.dashboard.change("cf1", position=(-1.0, 0.0, 0.01 * (k % 100)))
            if is_over.wait(0.02):
                return

    source = threading.Thread(target=fly)
    source.start()
    try:
        driver.execute_script(BUSY)
        wait_for(lambda: driver.execute_script("return came.length > 20"), "a scene that goes on")
        at_once = "return came.filter((time) => time < came[0] + 50).length"
        assert driver.execute_script(at_once) < 8
    finally:
        is_over.set()
        source.join()


def test_what_cannot_be_undone_is_pressed_for_a_second(browser, server, driver):
    server.dashboard.change("cf1", actions=frozenset({Action.REBOOT, Action.EMERGENCY}))
    browser.take_control()
    button = wait_for(lambda: browser.find(f"{browser.card('cf1')} button.reboot"), "its button")
    button.click()
    ActionChains(driver).click_and_hold(button).perform()
    wait_for(lambda: server.dashboard.commands, "the command")
    ActionChains(driver).release().perform()
    assert server.actions() == [(Action.REBOOT, ("cf1",))]


def test_an_alarm_is_heard_once_and_can_be_turned_off(browser, server, driver):
    browser.has("3 vehicles")
    server.dashboard.change("cf1", is_in_flight=True, is_battery_low=True)
    wait_for(lambda: driver.execute_script("return alarms.join()") == "cf1: battery low", "alarm")
    server.dashboard.change("cf2", is_emergency=True)
    wait_for(lambda: len(driver.execute_script("return alarms")) == 2, "another one")
    assert driver.execute_script("return alarms[1]") == "cf2: emergency"


def test_more_than_twenty_vehicles_are_a_table_that_sorts(browser, server):
    fleet = (vehicle(f"cf{k}", 0.1 * k, battery=3.0 + 0.04 * (k * 7 % 25)) for k in range(1, 26))
    server.dashboard.set_vehicles(*fleet)
    browser.has("25 vehicles")

    def names():
        return [
            row.text.split()[0] for row in browser.driver.find_elements("css selector", "tbody tr")
        ]

    wait_for(lambda: names() == [f"cf{k}" for k in range(1, 26)], "cf10 after cf9")
    browser.press("battery")
    lowest = sorted(range(1, 26), key=lambda k: k * 7 % 25)
    wait_for(lambda: names() == [f"cf{k}" for k in lowest], "the lowest battery first")
    browser.press("battery ▲")
    wait_for(lambda: names() == [f"cf{k}" for k in reversed(lowest)], "the highest first")
    browser.find('tr[data-vehicle="cf7"] input').click()
    browser.has("1 of 25 selected")
    browser.press("Show cards")
    assert browser.find(f"{browser.card('cf7')}.chosen")


def test_batteries_have_a_bar_and_what_is_low_has_a_sign(browser, server, driver):
    def shown(part, what):
        return driver.execute_script(
            f"return {what}", browser.find(f"{browser.card('cf1')} {part}")
        )

    server.dashboard.change("cf1", battery=3.6)
    browser.has("3.60 V", browser.card("cf1"))
    assert shown(".charge", "arguments[0].ariaValueNow") == "50"
    assert shown(".charge i", "arguments[0].style.width") == "50%"
    assert browser.count(f"{browser.card('cf1')} .warn") == 0
    server.dashboard.change("cf1", battery=3.06, is_battery_low=True)
    browser.has("3.06 V", f"{browser.card('cf1')} .warn")
    # Not by color alone.
    sign = "getComputedStyle(arguments[0], '::before').content"
    assert "⚠" in shown(".warn dd", sign)
    fleet = [vehicle(f"cf{k}", 0.1 * k, is_battery_low=k == 7) for k in range(1, 26)]
    server.dashboard.set_vehicles(*fleet)
    cell = wait_for(lambda: browser.find("tr[data-vehicle=cf7] td.warn"), "a cell with a warning")
    assert "⚠" in driver.execute_script(f"return {sign}", cell)


def test_states_differ_by_words_and_not_by_color_alone(browser, server):
    browser.has("on the ground", browser.card("cf1"))
    server.dashboard.change("cf2", is_emergency=True, state="emergency")
    server.dashboard.change("cf1", is_in_flight=True, state="hovering")
    browser.has("hovering", browser.card("cf1"))
    browser.has("cf2 · emergency", ".scene")
    browser.has("cf3 · 7 s old", ".scene")


def test_a_hundred_failures_are_one_message(browser, server):
    names = [f"cf{k}" for k in range(1, 101)]
    server.dashboard.set_vehicles(*(vehicle(name, 0.1 * k) for k, name in enumerate(names)))
    server.dashboard.refusals = dict.fromkeys(names[1:], "the battery is low")
    server.dashboard.refusals["cf1"] = "it has no pose"
    browser.take_control()
    browser.press("All")
    browser.has("100 of 100 selected")
    browser.press("Take off")
    browser.has("cf1: it has no pose")
    browser.has("99 vehicles: the battery is low")
    assert (browser.count(".q-notification"), browser.count(".strip")) == (0, 1)
    # What is refused stays, with a button that sends the same again.
    server.dashboard.refusals.clear()
    browser.press("Retry")
    browser.has("done", ".strip.done")
    assert server.actions() == 2 * [(Action.TAKEOFF, tuple(names))]


def test_a_command_is_a_strip_and_a_line_on_the_card_until_it_is_done(browser, server):
    server.dashboard.change("cf1", is_in_flight=True, state="flying", position=(-1.0, 0.0, 1.0))
    browser.take_control()
    browser.choose("cf1")
    server.dashboard.is_slow = True
    for axis, value in (("x", 1.0), ("y", 0.0), ("z", 1.0)):
        browser.enter(f'input[aria-label="{axis}, m"]', str(value))
    browser.press("Go")
    browser.has("1/1 accepted, 2.0 m and 4 s left", ".strip.under_way")
    browser.has("go to: 2.0 m left", browser.card("cf1"))
    server.dashboard.change("cf1", position=(1.0, 0.0, 1.0))
    browser.has("done", ".strip.done")
    wait_for(lambda: "go to:" not in browser.text(browser.card("cf1")), "nothing is left")


def test_what_cannot_be_done_is_grey_and_says_why(browser, server):
    browser.has("3 vehicles")

    def why(text):
        button = browser.button(text)
        return "" if button.is_enabled() else button.get_attribute("title")

    wait_for(lambda: why("Take off") == why("Go") == "take control first", "a watcher")
    watched = browser.find(f"{browser.card('cf1')} .acts button")
    assert not watched.is_enabled()
    assert browser.find(f"{browser.card('cf1')} button.emergency").is_enabled()
    browser.take_control()
    wait_for(lambda: why("Land") == "select vehicles first", "none is selected")
    browser.choose("cf1")
    down = "the selected vehicles are on the ground"
    for text, action in (("Land", "land"), ("Hold", "hold"), ("Go", "go to")):
        wait_for(lambda t=text, a=action: why(t) == f"{a}: {down}", text)
    assert why("Take off") == ""
    # Where the state is not known, a vehicle may be in the air.
    server.dashboard.change("cf1", state="not known")
    wait_for(lambda: why("Land") == "", "Land")
    # All take off, or none: services of a vehicle that starts come after its poses.
    server.dashboard.change("cf2", actions=frozenset())
    browser.choose("cf2")
    wait_for(lambda: why("Take off") == "take off: no service of cf2 is there for it", "cf2")
    server.dashboard.change("cf2", actions=ACTIONS)
    wait_for(lambda: why("Take off") == "", "Take off")


def test_those_land_that_fly(browser, server):
    server.dashboard.change("cf1", position=(-1.0, 0.0, 1.0), is_in_flight=True, state="flying")
    browser.take_control()
    browser.press("All")
    browser.press("Land")
    wait_for(lambda: server.dashboard.commands, "a command")
    # Where the state is not known, as of cf3, a vehicle may be in the air.
    assert server.actions() == [(Action.LAND, ("cf1", "cf3"))]


def test_all_are_reset_after_an_emergency(browser, server):
    browser.take_control()
    browser.press("All")
    browser.press("Emergency")
    browser.has("To fly again: Reset", ".emergency-report")
    wait_for(lambda: browser.button("Reset").is_displayed(), "Reset")
    assert browser.find('input[aria-label="height, m"]').rect["width"] > 30
    browser.press("Reset")
    wait_for(lambda: server.dashboard.commands, "a command")
    assert server.actions() == [(Action.RESET, ("cf1", "cf2", "cf3"))]


def test_the_emergency_is_in_a_window_of_any_size(browser, driver):
    try:
        # As a phone has it: a window of Chromium is wider.
        for width, height in ((360, 640), (500, 800), (700, 500), (900, 700)):
            metrics = {"width": width, "height": height, "deviceScaleFactor": 0.5, "mobile": False}
            driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
            rect = browser.find(".emergency-all").rect
            inner = driver.execute_script("return [innerWidth, innerHeight]")
            assert inner == [width, height]
            assert rect["x"] >= 0.0 and rect["x"] + rect["width"] <= inner[0]
            assert rect["y"] >= 0.0 and rect["y"] + rect["height"] <= inner[1]
            # Nothing is above it.
            x, y = rect["x"] + rect["width"] / 2, rect["y"] + rect["height"] / 2
            top = f"document.elementFromPoint({x}, {y}).closest('.emergency-all')"
            assert driver.execute_script(f"return {top} !== null")
            assert browser.find(".scene").rect["height"] > 100
            assert browser.find('input[aria-label="height, m"]').rect["width"] > 30
            # Nothing is outside the window.
            wide = "return document.documentElement.scrollWidth <= innerWidth"
            assert driver.execute_script(wide)
    finally:
        driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


NAMELESS = """
const named = (e) => e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim();
return [...document.querySelectorAll("button, input, select, [role=tab], [role=switch]")]
  .filter((e) => e.checkVisibility() && !named(e)).map((e) => e.outerHTML.slice(0, 200));
"""


def test_each_control_has_a_label(browser, driver):
    browser.has("3 vehicles")
    for tab in ("Vehicles", "Plots", "Parameters", "Missions", "Recordings", "Messages", "Cameras"):
        browser.tab(tab)
        assert driver.execute_script(NAMELESS) == []


def test_a_recording_is_ended_with_a_link_to_its_report(browser, server, tmp_path):
    server.dashboard.report_file = tmp_path / "report.html"
    server.dashboard.report_file.write_text("<title>the flight</title>")
    browser.take_control()
    browser.press("Record")
    browser.press("Stop recording")
    link = wait_for(lambda: browser.find("a.report"), "the link")
    with urllib.request.urlopen(link.get_attribute("href")) as answer:
        assert answer.read() == b"<title>the flight</title>"
    # While the dialog is still moving to its place, a click may miss the button.
    browser.command("Close", lambda: not browser.count("a.report"), "closed")
    browser.press("Record")
    browser.press("Stop recording")


def test_two_recordings_are_compared_on_one_page(browser, server, tmp_path):
    server.dashboard.report_file = tmp_path / "report.html"
    server.dashboard.report_file.write_text("<title>two flights</title>")
    server.dashboard.recorded = server.dashboard.recorded[1:]
    browser.tab("Recordings")
    browser.has("1 recording")
    # One that has been made while another panel was shown.
    browser.tab("Vehicles")
    wait_for(lambda: browser.find(browser.card("cf1")).is_displayed(), "another panel")
    server.dashboard.recorded = FakeDashboard().recorded
    browser.tab("Recordings")
    browser.has("2 recordings")
    browser.has("1:15", ".q-table")
    browser.has("cf1, cf2", ".q-table")
    boxes = browser.driver.find_elements("css selector", "tbody .q-checkbox")
    for box in boxes:
        box.click()
    browser.press("Compare")
    link = wait_for(lambda: browser.find("a.report"), "the link")
    names = ("2026-11-29_20-01-02", "2026-11-29_19-00-00")
    assert server.dashboard.made == [names]
    address = link.get_attribute("href")
    assert address.endswith("/report?" + "&".join(f"of={name}" for name in names))
    with urllib.request.urlopen(address) as answer:
        assert answer.read() == b"<title>two flights</title>"


def test_waypoints_are_set_dragged_inserted_undone_and_saved(browser, server):
    def points():
        return [
            [round(v, 1) for v in p]
            for p in browser.in_scene("waypoints.points.map((p) => p.toArray())")
        ]

    browser.take_control()
    browser.choose_tab("Missions", "cf1")
    wait_for(lambda: browser.find(".q-tab-panel .q-toggle").click() or True, "the switch")
    wait_for(lambda: browser.in_scene("isWaypointing"), "waypoints")
    for x, y in ((0.5, -1.0), (-0.7, -1.0)):
        count = len(points())
        browser.click_floor(x, y)
        wait_for(lambda count=count: len(points()) == count + 1, "one more")
    assert points() == [[0.5, -1.0, 1.0], [-0.7, -1.0, 1.0]]
    browser.drag_scene((0.5, -1.0, 1.0), (0.8, -0.8, 1.0))
    wait_for(lambda: points()[0] == [0.8, -0.8, 1.0], "the first one is moved")
    browser.click_scene(0.05, -0.9, 1.0)
    wait_for(lambda: len(points()) == 3, "one between them")
    assert points()[0] == [0.8, -0.8, 1.0] and points()[2] == [-0.7, -1.0, 1.0]
    browser.press("Undo")
    wait_for(lambda: len(points()) == 2, "as before")
    browser.press("Save")
    wait_for(lambda: server.dashboard.saved, "the mission")
    browser.press("Dry run")
    browser.has("The dry run has passed")
    ((path, saved),) = server.dashboard.saved.items()
    assert path == "/waypoints/waypoints.py"
    assert saved[1] == pytest.approx((-0.7, -1.0, 1.0), abs=0.03)


def test_the_distance_of_two_points_is_shown(browser, driver):
    browser.has("3 vehicles")
    for point in ((-0.5, -1.0, 0.0), (0.5, -1.0, 0.0)):
        browser.click_scene(*point, key=Keys.SHIFT)
    wait_for(lambda: browser.in_scene("measure.points.length") == 2, "two points")
    browser.has(" m", ".tag.measure")
    assert float(browser.text(".tag.measure").split()[0]) == pytest.approx(1.0, abs=0.03)
    browser.has("0 of 3 selected")


def test_keys_move_the_goal_and_are_explained(browser, server):
    browser.has("3 vehicles")
    browser.click_floor(0.5, -0.5)
    wait_for(lambda: browser.in_scene("goal.visible"), "the goal")
    x, y = (browser.in_scene(f"goal.position.{axis}") for axis in "xy")
    browser.type(Keys.ARROW_RIGHT, Keys.ARROW_UP, Keys.ARROW_UP, Keys.PAGE_DOWN)
    there = pytest.approx([x + 0.1, y + 0.2, 0.9])
    parts = ("goal.position.x", "goal.position.y", "goal.height")
    wait_for(lambda: [browser.in_scene(each) for each in parts] == there, "the goal is moved")
    browser.type("?")
    browser.has("emergency: stop the motors of all vehicles", ".keys")
    browser.type(Keys.ESCAPE)
    wait_for(lambda: not browser.count(".keys"), "closed")
    browser.press("Clear")
    wait_for(lambda: not browser.in_scene("goal.visible"), "no goal")


def test_the_page_is_light_or_dark_as_the_system_is(browser, driver):
    def has(scheme):
        feature = {"name": "prefers-color-scheme", "value": scheme}
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        color = "getComputedStyle(document.body).backgroundColor"
        level = f"return Number({color}.match(/\\d+/)[0])"
        scene = "scene.background.r"
        is_light = scheme == "light"
        wait_for(lambda: (driver.execute_script(level) > 128) == is_light, scheme)
        wait_for(lambda: (browser.in_scene(scene) > 0.5) == is_light, f"a {scheme} scene")

    has("light")
    has("dark")


def test_all_vehicles_are_in_view_when_the_page_is_loaded(browser, driver, server):
    places = [(x, y, 1.0) for x in (-6.0, 6.0) for y in (-6.0, 6.0)]
    server.dashboard.set_vehicles(*(vehicle(f"cf{k}", *p) for k, p in enumerate(places)))
    driver.get(server.url)

    def are_in_view():
        left, top, width, height = (
            browser.find(".scene").rect[k] for k in ("x", "y", "width", "height")
        )
        seen = [browser.in_scene("screen({}, {}, {})".format(*place)) for place in places]
        return all(left < x < left + width and top < y < top + height for x, y in seen)

    wait_for(are_in_view, "all four in view", 15.0)


def test_the_bar_has_the_steps_of_a_mission(browser, server):
    steps = (Step("takeoff: cf1", 2.0, "done"), Step("go_to: cf1", 4.0, "now"))
    server.dashboard.set_vehicles(
        vehicle("cf1", 0.0), missions=("square.py · 4 s left",), steps=steps
    )
    wait_for(lambda: browser.count(".steps span") == 2, "steps")
    assert browser.text(".steps .now") == "go_to: cf1"
    widths = [browser.find(f".steps .{state}").rect["width"] for state in ("done", "now")]
    assert widths[1] > 1.8 * widths[0]
    server.dashboard.set_vehicles(vehicle("cf1", 0.0))
    wait_for(lambda: browser.count(".steps") == 0, "no steps")


def test_the_address_has_what_is_selected(browser, driver, server):
    server.dashboard.set_vehicles(vehicle("cf1", 0.0), vehicle("cf2", 0.0))
    browser.choose("cf2")
    browser.has("x -2 to 2, y -2 to 2.5, z 0 to 3 m: the room of the world file", ".limits")
    wait_for(lambda: driver.current_url.endswith("vehicles=cf2"), "the selection in the address")
    driver.switch_to.new_window("tab")
    try:
        driver.get(server.url + "?vehicles=cf2")
        wait_for(lambda: browser.find(f"{browser.card('cf2')}.chosen"), "cf2 is selected")
    finally:
        driver.close()
        driver.switch_to.window(driver.window_handles[0])
    browser.press("None")
    wait_for(lambda: "vehicles" not in driver.current_url, "no selection in the address")


def test_the_bar_has_one_height(browser, driver, server):
    try:
        for width in (1400, 900, 390):
            metrics = {"width": width, "height": 844, "deviceScaleFactor": 0.5, "mobile": False}
            driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
            for missions in ((), ("a mission with a name that is long · takeoff: cf1",)):
                server.dashboard.set_vehicles(vehicle("cf1", 0.0), missions=missions)
                wait_for(lambda m=missions: browser.count(".timebar .mission") == len(m), width)
                assert browser.find(".bar").rect["height"] == 52
                take = browser.find(".take").rect
                assert take["x"] + take["width"] <= width, (width, missions)
                emergency = browser.find(".emergency-all")
                inner = "arguments[0].scrollWidth <= arguments[0].clientWidth"
                assert driver.execute_script(f"return {inner}", emergency), (width, missions)
    finally:
        driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_vehicles_of_the_address_that_are_found_later_have_plots(browser, driver, server):
    server.dashboard.set_vehicles()
    driver.get(server.url + "?vehicles=cf1")
    browser.has("0 vehicles", ".summary")
    wait_for(lambda: server.dashboard.pages.pages, "a connection")
    server.dashboard.set_vehicles(vehicle("cf1", 0.0))
    wait_for(lambda: server.dashboard.watched == ("cf1",), "plots of cf1")
