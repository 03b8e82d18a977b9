"""Firmware parameters in headless Chromium: a virtual vehicle, the driver, a whole dashboard."""

import pytest
from fake_fleet import FakeLane, FakeMaster
from pages import Browser, wait_for

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.discovery import Graph
from crazyflie_dashboard.page import server as page_server
from crazyflie_dashboard.page.view import View
from crazyflie_driver.server_node import CrazyflieServerNode
from crazyflie_driver.srv import AddCrazyflieRequest
from crazyflie_utils.testing.fake_process import FakeProcess
from crazyflie_utils.testing.fixtures import own_cache  # noqa: F401
from crazyflie_virtual.testing import virtual_vehicle

LIMIT = 60.0  # Timeout of connecting on a loaded machine (s).


@pytest.fixture
def driven():
    """Yield a process with a driver that has connected to a virtual vehicle, and its firmware."""
    process, node = FakeProcess(), CrazyflieServerNode()
    with virtual_vehicle() as (vehicle, uri):
        assert process.launch(node, "/crazyflie_server")
        request = AddCrazyflieRequest(uri=uri, tf_prefix="cf1", enable_parameters=True)
        process.call("/add_crazyflie", request).result(LIMIT)
        yield process, vehicle.vehicle.board.firmware
        node.shutdown()


@pytest.fixture
def live(driven, server, driver, monkeypatch):
    """Return a page of the process's dashboard, and the firmware."""
    process, firmware = driven
    services = dict.fromkeys(process.transport.services, "/crazyflie_server")
    handle, graph = process.handle("/dashboard"), Graph(services=services)
    dashboard = Dashboard(handle, FakeMaster(process, lambda: graph), FakeLane(), [])
    # NiceGUI has one server in a process: its next page shows this dashboard.
    monkeypatch.setattr(page_server, "View", lambda _: View(dashboard))
    browser = Browser(driver, server.url)
    browser.open()
    wait_for(lambda: process.advance(0.1) or "1 vehicle " in browser.text(), "the vehicle")
    yield browser, firmware
    driver.get("about:blank")
    wait_for(lambda: not dashboard.pages.pages, "no page")
    dashboard.close()


def test_firmware_parameters_right_and_wrong(live):
    browser, firmware = live
    browser.take_control()
    browser.tab("Parameters")
    browser.select("node or vehicle", "cf1")
    browser.has("parameters; the first 30 are shown")
    browser.enter(".search input", "enHighLevel")
    row = '.parameter[data-name="commander.enHighLevel"]'
    wait_for(lambda: browser.count(".parameter") == 1 and browser.find(row), "one parameter")
    assert browser.find(f"{row} input").get_attribute("value") == "1"
    browser.enter(f"{row} input", "0\n")
    browser.has("is 0 now", row)
    assert firmware.commander.high_level_enabled == 0
    browser.enter(f"{row} input", "300\n")
    browser.has("commander.enHighLevel is a uint8_t; 300 does not fit", row)
    browser.enter(f"{row} input", "much\n")
    browser.has("cf1: commander.enHighLevel is 'much'; expected a whole number", row)
    assert firmware.commander.high_level_enabled == 0
