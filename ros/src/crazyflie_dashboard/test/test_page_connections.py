"""Connections of pages in headless Chromium: control, reloads, other origins, tokens."""

import subprocess
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pages
from nicegui import core
from pages import Browser, wait_for
from selenium.webdriver.common.keys import Keys

from crazyflie_dashboard.page_data import MAX_COMMAND_AGE
from crazyflie_dashboard.snapshot import Action


def test_two_pages_and_control(browser, server, driver):
    first = driver.current_window_handle
    browser.take_control()
    driver.switch_to.new_window("window")
    try:
        second = Browser(driver, server.url)
        second.open()
        second.choose("cf1")
        assert not second.button("Take off").is_enabled()
        second.press("Take control")
        second.has("Take over")
        second.press("Take over")
        second.has("this page has taken over control")
        second.press("Take off")
        second.has("hovering", second.card("cf1"))
        driver.switch_to.window(first)
        browser.has("has taken over control: this page can only watch now")
        # The first page's emergency works all the same.
        browser.press("Emergency")
        browser.has("emergency", browser.card("cf1") + " .state")
        driver.switch_to.window(driver.window_handles[-1])
    finally:
        driver.close()
        driver.switch_to.window(first)


def test_a_page_that_is_loaded_again_in_flight_moves_nothing_and_goes_on(browser, server):
    browser.take_control()
    browser.choose("cf1", "cf2")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))
    browser.tab("Missions")
    browser.select("mission or trajectory", "square.py")
    browser.press("Dry run")
    browser.has("The dry run has passed")
    browser.open()
    browser.has("you have control", ".control")
    browser.has("For cf1, cf2")
    browser.press("Fly")
    wait_for(lambda: server.dashboard.flown == ["/missions/square.py"], "the mission")
    browser.has("fly square.py with cf1, cf2", ".strip")
    assert server.actions() == [(Action.TAKEOFF, ("cf1", "cf2"))]


def test_a_page_that_is_loaded_again_has_no_control_if_another_one_took_it(browser, server, driver):
    browser.take_control()
    browser.choose("cf1")
    driver.get("about:blank")
    wait_for(lambda: not server.dashboard.pages.pages, "no page")
    server.dashboard.pages.take(server.dashboard.pages.open(str))
    browser.open()
    browser.has("has control", ".control")
    browser.has("1 of 3 selected")
    assert not browser.button("Take off").is_enabled()
    server.dashboard.pages.close(server.dashboard.pages.controller)


def test_the_emergency_is_reached_while_a_dialog_is_open(browser, server, driver):
    other = server.dashboard.pages.open(lambda text: None)
    try:
        server.dashboard.pages.take(other)
        browser.press("Take control")
        browser.has("Watch only")
        # Selenium refuses to click what is covered.
        browser.find(".emergency-all").click()
        wait_for(lambda: server.dashboard.emergencies == [None], "the emergency by its button")
        browser.type(Keys.ESCAPE, Keys.ESCAPE)
        wait_for(lambda: server.dashboard.emergencies == [None, None], "the emergency by its key")
    finally:
        server.dashboard.pages.close(other)


def test_a_click_that_has_waited_moves_nothing(browser, server, driver):
    server.dashboard.max_age = MAX_COMMAND_AGE
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


def test_a_connection_that_is_lost_and_comes_back_moves_nothing_and_has_no_control(
    browser, server, driver
):
    browser.take_control()
    browser.choose("cf1")
    browser.press("Take off")
    browser.has("hovering", browser.card("cf1"))
    before = browser.text(".control").split()[1]
    # Clicks without a connection are sent when the connection is back; those while it is being
    # closed, which takes until all before them is sent, are lost.
    script = """
        const land = arguments[0];
        window.socket.once("disconnect", () => land.click());
        window.socket.io.engine.close();
    """
    driver.execute_script(script, browser.button("Land"))
    browser.has("no page has control", ".control")
    assert browser.text(".control").split()[1] != before
    assert server.actions() == [(Action.TAKEOFF, ("cf1",))]
    browser.take_control()
    browser.press("Land")
    browser.has("on the ground", browser.card("cf1"))


def test_a_browser_that_was_busy_for_seconds_keeps_its_page(browser, server, driver, monkeypatch):
    monkeypatch.setattr(core.sio.eio, "ping_interval", 0.2)
    browser.open()
    browser.take_control()
    before = server.dashboard.pages.pages
    driver.execute_script("const end = performance.now() + 3000; while (performance.now() < end);")
    browser.press("All")
    browser.has("3 of 3 selected")
    assert server.dashboard.pages.pages == before
    assert "you have control" in browser.text(".control")


def test_a_page_of_another_address_needs_the_token(driver):
    # NiceGUI has one server in a process.
    command = [sys.executable, pages.__file__, "127.0.0.2", "a token that was printed"]
    with subprocess.Popen(command, stdin=-1, stdout=-1, text=True) as process:
        url, _, token = process.stdout.readline().strip().partition("?token=")
        browser = Browser(driver, f"{url}?token={token}")
        for wrong in ("", "?token=another"):
            driver.get(url + wrong)
            browser.has("Refused: the token is missing or wrong")
        browser.open()
        browser.has("3 vehicles")
        assert driver.current_url == url
        process.stdin.close()
    driver.get_log("browser")


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
    with ThreadingHTTPServer(("127.0.0.1", 0), files) as other:
        threading.Thread(target=other.serve_forever, daemon=True).start()
        driver.get(f"http://127.0.0.1:{other.server_port}/")
        wait_for(lambda: driver.title.startswith("tried:"), "the attack")
        assert driver.title == "tried:"
        other.shutdown()
    driver.get_log("browser")


def test_an_old_browser_gets_a_message(browser, driver, server):
    script = {"source": "delete HTMLScriptElement.supports"}
    added = driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", script)
    try:
        driver.get(server.url)
        browser.has("This browser is too old")
    finally:
        driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", added)
        # The page goes on to speak to the browser, which does not understand it.
        driver.get("about:blank")
        driver.get_log("browser")
