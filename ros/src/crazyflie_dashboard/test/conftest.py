"""A page of vehicles that are only numbers, and Chromium, once for all tests of the page."""

import pytest


@pytest.fixture(scope="session")
def server():
    # Here, since most tests need neither NiceGUI nor selenium.
    from pages import Server

    server = Server()
    yield server
    server.page.close()


@pytest.fixture(scope="session")
def driver():
    from pages import chromium

    # A quarter of the pixels: to draw them in software is most of what these tests cost.
    with chromium(scale=0.5) as driver:
        yield driver


@pytest.fixture
def browser(server, driver):
    from pages import Browser

    server.dashboard.reset()
    server.errors.clear()
    browser = Browser(driver, server.url)
    browser.open()
    yield browser
    # The next page is that of another tab: this one's would have its selection and control.
    driver.execute_script("location.protocol === 'about:' || sessionStorage.clear()")
    # Only files of the page itself are loaded, and nothing fails.
    errors = [each["message"] for each in driver.get_log("browser") if each["level"] == "SEVERE"]
    assert errors == []
    assert server.errors == []
