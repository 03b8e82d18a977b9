"""Three simulated vehicles, flown from a page in Chromium."""

import math

import pytest
import rosgraph
from pages import Browser, Server, chromium, stopped, wait_for
from selenium.webdriver.common.keys import Keys

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.emergency import EmergencyLane
from crazyflie_dashboard.master import Master
from crazyflie_utils.main import ros_process


@pytest.fixture(scope="module")
def dashboard():
    process = ros_process()
    handle = process.handle("/dashboard")
    master = Master("/dashboard")
    found = Dashboard(handle, master, EmergencyLane(master, handle.warn), [])
    process.start()
    yield found
    found.close()
    process.stop()


@pytest.fixture(scope="module")
def browser(dashboard):
    server = Server(dashboard)
    with chromium(scale=0.5) as driver:
        browser = Browser(driver, server.url)
        browser.open()
        browser.has("3 vehicles")
        yield browser
    server.page.close()


def vehicle(dashboard, name):
    return dashboard.scene().vehicles[name]


def test_all_take_off_go_where_the_floor_is_clicked_and_land(browser, dashboard):
    for name in ("cf1", "cf2", "cf3"):
        browser.has("on the ground", browser.card(name))
    middle = sum(each.position[0] for each in dashboard.scene().vehicles.values()) / 3
    browser.take_control()
    browser.press("All")
    fly(browser, "Take off", "3 in flight")
    wait_for(lambda: vehicle(dashboard, "cf3").position[2] > 0.9, "cf3 at its height")
    x = vehicle(dashboard, "cf1").position[0]
    browser.click_floor(middle + 0.4, 0.0)
    browser.command(
        "Go", lambda: abs(vehicle(dashboard, "cf1").position[0] - x - 0.4) < 0.1, "cf1 is there"
    )
    fly(browser, "Land", "0 in flight")
    wait_for(lambda: vehicle(dashboard, "cf2").position[2] < 0.03, "cf2 on the ground")


def fly(browser, command, seen):
    browser.command(command, lambda: seen in browser.text(), seen)


def go(browser, goal, is_there, what):
    for axis, value in zip("xyz", goal, strict=True):
        browser.enter(f'input[aria-label="{axis}, m"]', f"{value:.2f}")
    browser.command("Go", is_there, what)


def test_two_above_each_other_keep_their_distance(browser, dashboard):
    def place(name):
        return vehicle(dashboard, name).position

    def is_near(name, goal):
        return math.dist(place(name), goal) < 0.15

    browser.press("None")
    browser.choose("cf1", "cf2")
    browser.has("on the ground", browser.card("cf2"))
    fly(browser, "Take off", "2 in flight")
    for name in ("cf1", "cf2"):
        wait_for(lambda name=name: place(name)[2] > 0.9, f"{name} at its height")
    x, y, _ = place("cf2")
    browser.press("None")
    browser.choose("cf1")
    # The way there would lead through the other.
    refusal = "cf1 and cf2 would be 0."
    go(browser, (x, y, 1.0), lambda: refusal in browser.text(), "the refusal")
    go(browser, (place("cf1")[0], y, 2.0), lambda: place("cf1")[2] > 1.9, "cf1 above")
    go(browser, (x, y, 2.0), lambda: is_near("cf1", (x, y, 2.0)), "cf1 above cf2")
    browser.choose("cf2")
    below = (x + 0.5, y, 1.0)
    go(browser, (x + 0.5, y, 1.5), lambda: is_near("cf2", below), "cf2 below the goal")
    wait_for(lambda: is_near("cf1", (x + 0.5, y, 2.0)), "cf1 above it")
    fly(browser, "Land", "0 in flight")


def test_the_key_of_the_emergency_counts_right_after_loading_with_a_stopped_master(
    browser, dashboard
):
    browser.press("None")
    browser.choose("cf1")
    browser.has("on the ground", browser.card("cf1"))
    fly(browser, "Take off", "1 in flight")
    # Plotted topics are received for one page only: the subscription begins and ends with the page.
    wait_for(lambda: "cf1" in dashboard.plots(dashboard.pages.pages[-1]), "plots")
    with stopped(rosgraph.Master("/dashboard").getPid()):
        browser.driver.get(browser.url)
        browser.type(Keys.ESCAPE, Keys.ESCAPE)
        browser.has("Emergency: all have answered", ".emergency-report")
        browser.has("emergency", browser.card("cf1") + " .state")
        wait_for(lambda: vehicle(dashboard, "cf1").position[2] < 0.05, "cf1 has fallen")
        browser.choose("cf2")
        assert "held up" not in browser.text(".summary")
