"""Headless Chromium and a page of a `FakeDashboard`, for tests."""

import contextlib
import os
import signal
import socket
import sys
import time

from fake_dashboard import FakeDashboard
from nicegui import app
from selenium import webdriver
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from crazyflie_dashboard.access import Access
from crazyflie_dashboard.page import Page
from crazyflie_utils.testing.programs import free_port

LONGEST_WAIT = 60.0
"""s, for what a loaded machine does in one."""


def wait_for(condition, what, limit=LONGEST_WAIT):
    """Return the first true result of a condition; the page may replace what it looks at."""
    end = time.monotonic() + limit
    cause = "no error"
    while time.monotonic() < end:
        try:
            if result := condition():
                return result
        except WebDriverException as error:
            cause = error
        time.sleep(0.05)
    raise AssertionError(f"not within {limit} s: {what}; last: {cause}")


@contextlib.contextmanager
def chromium(scale=1.0):
    """Yield a headless Chromium that draws in software, ``scale`` pixels for each of CSS."""
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in (
        *("--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"),
        *("--enable-unsafe-swiftshader", "--window-size=1100,800"),
        f"--force-device-scale-factor={scale}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    try:
        yield browser
    finally:
        browser.quit()


@contextlib.contextmanager
def stopped(process):
    """Stop a process, as one that hangs, for as long as the block takes."""
    os.kill(process, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(process, signal.SIGCONT)


class Browser:
    """Actions of an operator in one window of Chromium."""

    def __init__(self, driver, url):
        self.driver, self.url = driver, url

    def open(self):
        """Load the page, and wait until it is drawn."""
        self.driver.get(self.url)
        wait_for(lambda: self.driver.execute_script("return window.did_handshake"), "a connection")
        wait_for(lambda: "page 0" not in self.text(".control"), "a number of the page")

    def find(self, selector):
        """Return the first element of a CSS selector."""
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def count(self, selector):
        """Return how many elements a CSS selector has."""
        return len(self.driver.find_elements(By.CSS_SELECTOR, selector))

    def text(self, selector="body"):
        """Return the text that is seen of an element."""
        return self.find(selector).text

    def has(self, text, selector="body"):
        """Wait until a text is seen."""
        wait_for(lambda: text in self.text(selector), f"{text!r} in {selector}")

    def button(self, text):
        """Return a button by its text."""
        spans = f".//span[normalize-space(.)='{text}']"
        path = f"//button[{spans} or normalize-space(.)='{text}']"
        return self.driver.find_element(By.XPATH, path)

    def press(self, text):
        """Click a button by its text, once it can be pressed."""

        def click():
            button = self.button(text)
            return button.is_enabled() and (button.click() or True)

        wait_for(click, f"button {text}")

    def command(self, text, is_done, what):
        """Click a button until its command is carried out: one that has become old does nothing."""
        for _ in range(5):
            self.press(text)
            with contextlib.suppress(AssertionError):
                return wait_for(is_done, what, LONGEST_WAIT / 5.0)
        raise AssertionError(f"{text}: not {what}")

    def select(self, label, option):
        """Choose an option of a list."""
        field = f"//label[contains(@class,'q-field')][.//*[text()='{label}']]"
        wait_for(lambda: self.driver.find_element(By.XPATH, field).click() or True, label)
        item = f"//*[contains(@class,'q-menu')]//*[contains(@class,'q-item')]//*[text()='{option}']"
        wait_for(lambda: self.driver.find_element(By.XPATH, item).click() or True, option)

    def tab(self, name):
        """Choose a panel."""
        tab = f"//*[contains(@class,'q-tab__label') and text()='{name}']"
        wait_for(lambda: self.driver.find_element(By.XPATH, tab).click() or True, f"tab {name}")

    def choose_tab(self, tab, *names):
        """Choose vehicles, then a panel."""
        self.tab("Vehicles")
        self.choose(*names)
        self.tab(tab)

    def card(self, name):
        """Return the selector of a vehicle's card."""
        return f'.card[data-vehicle="{name}"]'

    def choose(self, *names):
        """Choose vehicles by the boxes of their cards, in addition to the chosen ones."""
        for name in names:
            wait_for(lambda name=name: self.find(f"{self.card(name)} input").click() or True, name)
            wait_for(lambda name=name: self.find(f"{self.card(name)}.chosen"), f"{name} chosen")

    def take_control(self):
        """Press the button, and wait for control."""
        self.press("Take control")
        self.has("you have control")

    def click_floor(self, x, y):
        """Click on the floor, m."""
        self.click_scene(x, y, 0.0)

    def click_scene(self, x, y, z, key=""):
        """Click on what is at a point of the scene, m, while a key is down."""
        chain = self._pointer_at((x, y, z))
        (chain.key_down(key).click().key_up(key) if key else chain.click()).perform()

    def drag_scene(self, start, end):
        """Drag what is at a point of the scene, m, to another one."""
        x, y = (b - a for a, b in zip(self._place(start), self._place(end), strict=True))
        chain = self._pointer_at(start).click_and_hold().move_by_offset(x // 2, y // 2)
        chain.move_by_offset(x - x // 2, y - y // 2).release().perform()

    def in_scene(self, what):
        """Return the value of an expression of the scene's component in the browser."""
        find = "const e = document.querySelector('.scene'); return getElement(e.id.slice(1))."
        return self.driver.execute_script(find + what)

    def _place(self, point):
        return [round(each) for each in wait_for(lambda: self._screen(point), "the scene")]

    def _screen(self, point):
        return self.in_scene("screen({}, {}, {})".format(*point))

    def _pointer_at(self, point):
        scene = self.find(".scene canvas")
        x, y = self._place(point)
        rect = scene.rect
        offset = int(x - rect["x"] - rect["width"] / 2), int(y - rect["y"] - rect["height"] / 2)
        return ActionChains(self.driver).move_to_element_with_offset(scene, *offset)

    def type(self, *keys):
        """Press keys."""
        ActionChains(self.driver).send_keys(*keys).perform()

    def enter(self, selector, text):
        """Replace the text of a field."""
        field = self.find(selector)
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys(text)


class Server:
    """The page of a dashboard, of a `FakeDashboard` by default."""

    def __init__(self, dashboard=None, host="127.0.0.1", token=""):
        self.port = free_port(socket.SOCK_STREAM)
        self.dashboard = dashboard or FakeDashboard()
        access = Access(host, self.port, token)
        self.url = access.url
        self.errors = []  # What handlers and timers of the page have raised.
        app.on_exception(self.errors.append)
        self.page = Page(self.dashboard, access)

    def actions(self):
        """Return the commands that have come: actions and vehicles."""
        return [(each.action, each.vehicles) for each in self.dashboard.commands]


if __name__ == "__main__":
    # HOST TOKEN: serve until the end of stdin.
    print(Server(host=sys.argv[1], token=sys.argv[2]).url, flush=True)
    sys.stdin.read()
