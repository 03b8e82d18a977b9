"""Three simulated vehicles, flown from a page in Chromium."""

from functools import partial

import pytest
from pages import Browser, Server, chromium, wait_for
from selenium.webdriver.common.keys import Keys

from crazyflie_dashboard import master
from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.dashboard_node import new_lane
from crazyflie_utils.main import ros_process


@pytest.fixture(scope="module")
def dashboard():
    process = ros_process()
    handle = process.handle("/dashboard")
    found = Dashboard(handle, partial(master.read, "/dashboard"), new_lane(handle), [])
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
    browser.press("Take off")
    browser.has("3 in flight")
    wait_for(lambda: vehicle(dashboard, "cf3").position[2] > 0.9, "cf3 at its height")
    x = vehicle(dashboard, "cf1").position[0]
    browser.click_floor(middle + 0.4, 0.0)
    browser.press("Go")
    wait_for(lambda: abs(vehicle(dashboard, "cf1").position[0] - x - 0.4) < 0.1, "cf1 is there")
    browser.press("Land")
    browser.has("0 in flight")
    wait_for(lambda: vehicle(dashboard, "cf2").position[2] < 0.03, "cf2 on the ground")


def test_the_key_of_the_emergency_stops_a_flight(browser, dashboard):
    browser.press("None")
    browser.choose("cf1")
    browser.has("on the ground", browser.card("cf1"))
    browser.press("Take off")
    browser.has("1 in flight")
    browser.type(Keys.ESCAPE, Keys.ESCAPE)
    browser.has("emergency", browser.card("cf1") + " .state")
    wait_for(lambda: vehicle(dashboard, "cf1").position[2] < 0.05, "cf1 has fallen")
