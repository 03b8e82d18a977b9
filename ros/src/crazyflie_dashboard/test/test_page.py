"""The page in headless Chromium, with vehicles that are only numbers."""

import threading
from functools import partial
from http.server import HTTPServer, SimpleHTTPRequestHandler

import pytest
from fake_dashboard import vehicle
from pages import Browser, Server, chromium, wait_for
from selenium.webdriver.common.keys import Keys

from crazyflie_dashboard.snapshot import Action


@pytest.fixture(scope="module")
def server():
    server = Server()
    yield server
    server.page.close()


@pytest.fixture(scope="module")
def driver():
    with chromium() as driver:
        yield driver


@pytest.fixture
def browser(server, driver):
    server.dashboard.reset()
    browser = Browser(driver, server.url)
    browser.open()
    yield browser
    # Only files of the page itself are loaded, and nothing fails.
    errors = [each["message"] for each in driver.get_log("browser") if each["level"] == "SEVERE"]
    assert errors == []


def actions(server):
    return [(each.action, each.vehicles) for each in server.dashboard.commands]


def test_vehicles_take_off_go_where_the_floor_is_clicked_and_land(browser, server):
    browser.take_control()
    browser.choose("cf1", "cf2")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))
    browser.click_floor(0.5, -0.5)
    browser.press("Go")
    wait_for(lambda: len(server.dashboard.commands) == 3, "two commands more")
    # Both keep their formation: their middle is where the click was, at the height of the takeoff.
    goals = [command.goal for command in server.dashboard.commands[1:]]
    assert goals[0] == pytest.approx((0.0, -0.5, 1.0), abs=0.02)
    assert goals[1] == pytest.approx((1.0, -0.5, 1.0), abs=0.02)
    browser.press("Land")
    browser.has("on the ground", browser.card("cf1"))
    assert actions(server) == [
        (Action.TAKEOFF, ("cf1", "cf2")),
        (Action.GO_TO, ("cf1",)),
        (Action.GO_TO, ("cf2",)),
        (Action.LAND, ("cf1", "cf2")),
    ]


def test_a_stale_vehicle_says_how_old_its_pose_is(browser):
    browser.has("3 vehicles")
    browser.has("cf3 · 7 s old", ".scene")
    browser.has("7.4 s ago", browser.card("cf3"))
    assert "stale" in browser.find(browser.card("cf3")).get_attribute("class")
    assert "stale" not in browser.find(browser.card("cf1")).get_attribute("class")


def test_a_vehicle_that_is_clicked_in_the_scene_is_chosen(browser):
    browser.has("0 of 3 chosen")
    browser.click_scene(-1.0, 0.0, 0.01)
    browser.has("1 of 3 chosen")
    assert browser.find(f"{browser.card('cf1')}.chosen")


def test_the_key_of_the_emergency_works_without_control(browser, server):
    server.dashboard.change("cf1", is_in_flight=True, position=(-1.0, 0.0, 1.0))
    browser.type(Keys.ESCAPE, Keys.ESCAPE)
    browser.has("emergency", browser.card("cf1") + " .state")
    assert actions(server) == [(Action.EMERGENCY, ("cf1", "cf2", "cf3"))]


def test_one_escape_is_no_emergency(browser, server):
    browser.type(Keys.ESCAPE)
    browser.take_control()
    browser.choose("cf1")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))
    assert actions(server) == [(Action.TAKEOFF, ("cf1",))]


def test_boxes_show_what_is_chosen(browser):
    browser.press("All")
    browser.has("3 of 3 chosen")
    browser.press("None")
    browser.choose("cf2")
    browser.has("1 of 3 chosen")
    boxes = [browser.find(f"{browser.card(name)} input") for name in ("cf1", "cf2", "cf3")]
    wait_for(lambda: [each.is_selected() for each in boxes] == [False, True, False], "boxes")


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


def test_two_pages_and_control(browser, server, driver):
    first = driver.current_window_handle
    browser.take_control()
    driver.switch_to.new_window("window")
    try:
        second = Browser(driver, server.url)
        second.open()
        second.choose("cf1")
        second.press("Take off")
        second.has("this page only looks")
        assert server.dashboard.commands == []
        second.press("Take control")
        second.has("Take over")
        second.press("Take over")
        second.has("this page has taken over control")
        second.press("Take off")
        second.has("hovering", second.card("cf1"))
        driver.switch_to.window(first)
        browser.has("has taken over control: this page only looks now")
        # The first page's emergency works all the same.
        browser.press("Emergency")
        browser.has("emergency", browser.card("cf1") + " .state")
        driver.switch_to.window(driver.window_handles[-1])
    finally:
        driver.close()
        driver.switch_to.window(first)


def test_a_page_that_is_loaded_again_in_flight_moves_nothing_and_has_no_control(browser, server):
    browser.take_control()
    browser.choose("cf1")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))
    browser.open()
    browser.has("hovering", browser.card("cf1"))
    browser.has("no page has control", ".control")
    browser.choose("cf1")
    browser.press("Land")
    browser.has("this page only looks")
    assert actions(server) == [(Action.TAKEOFF, ("cf1",))]


def test_a_click_that_has_waited_moves_nothing(browser, server, driver):
    browser.take_control()
    browser.choose("cf1")
    # A click waits while the browser is busy.
    driver.execute_script(
        "const event = new MouseEvent('click', { bubbles: true });"
        "setTimeout(() => arguments[0].dispatchEvent(event), 1500)",
        browser.button("Take off"),
    )
    browser.has("s old")
    assert server.dashboard.commands == []


def test_parameters_right_and_wrong(browser, server):
    browser.tab("Parameters")
    browser.select("node or vehicle", "/cf1/controller")
    row = '.parameter[data-name="K/gain"]'
    browser.has("float · 1/s · 0 to 2 · gain of the height", row)
    browser.enter(f"{row} input", "0.75\n")
    browser.has("is 0.75 now", row)
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
    browser.select("mission or trajectory", "square.py: flies a square")
    browser.press("Dry run")
    browser.has("The dry run has passed: 12.0 s, all land")
    wait_for(lambda: browser.button("Fly").is_enabled(), "Fly can be pressed")
    browser.press("Fly")
    browser.has("square.py: flies a square: landed")
    assert server.dashboard.flown == ["/missions/square.py"]


def test_messages_and_plots(browser):
    browser.tab("Messages")
    browser.has("cf2 has a weak link")
    browser.has("move the antenna")
    browser.has("<b>link</b> at 40 %")
    browser.tab("Plots")
    wait_for(lambda: browser.find(".chart canvas"), "plots")
    browser.enter("input[aria-label^='another field']", "/cf1/imu/x")
    browser.press("Add")
    browser.has("/cf1/imu/x", ".q-chip")
    browser.find(".q-chip__icon--remove").click()
    wait_for(lambda: "/cf1/imu" not in browser.text(".panels"), "the field is gone")
    browser.press("Stop")
    browser.has("height, m", ".q-table")
    browser.has("0.599", ".q-table")  # The height has risen by so much.


HOSTILE = """<script>
const seen = [], url = "127.0.0.1:PORT/_nicegui_ws/socket.io/?EIO=4&transport=";
const socket = new WebSocket("ws://" + url + "websocket");
socket.onopen = () => seen.push("open");
socket.onclose = () => fetch("http://" + url + "polling").then(
  () => seen.push("answer"), () => {}).finally(() => { document.title = "tried:" + seen; });
</script>"""


def test_a_hostile_page_in_the_same_browser_opens_no_websocket(browser, server, driver, tmp_path):
    (tmp_path / "index.html").write_text(HOSTILE.replace("PORT", str(server.port)))
    files = partial(SimpleHTTPRequestHandler, directory=tmp_path)
    with HTTPServer(("127.0.0.1", 0), files) as other:
        threading.Thread(target=other.serve_forever, daemon=True).start()
        driver.get(f"http://127.0.0.1:{other.server_port}/")
        wait_for(lambda: driver.title.startswith("tried:"), "the attack")
        assert driver.title == "tried:"
        other.shutdown()
    driver.get_log("browser")


def test_an_old_browser_is_told_so(browser, driver, server):
    script = {"source": "delete HTMLScriptElement.supports"}
    added = driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", script)
    try:
        driver.get(server.url)
        browser.has("This browser is too old")
    finally:
        driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", added)
        driver.get_log("browser")
