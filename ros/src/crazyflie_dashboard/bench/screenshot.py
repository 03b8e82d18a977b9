#!/usr/bin/env python3
"""Draw the picture of the page: a flight of three simulated vehicles.

Usage: screenshot.py [FILE]
"""

import os
import socket
import subprocess
import sys
import time
from pathlib import Path

from crazyflie_utils.testing.programs import free_port

HERE = Path(__file__).resolve()
sys.path.insert(0, str(HERE.parents[1] / "test"))

from pages import Browser, chromium, wait_for  # noqa: E402  Helpers of the tests.

PICTURE = HERE.parents[4] / "docs" / "images" / "dashboard.png"


def draw(port: int, file: Path) -> None:
    """Fly from the page on a port, and write what it shows."""
    with chromium() as driver:
        driver.set_window_size(1440, 1040)
        browser = Browser(driver, f"http://127.0.0.1:{port}/")
        wait_for(lambda: browser.open() or True, "the page")
        browser.has("3 vehicles")
        browser.take_control()
        browser.press("All")
        browser.press("Take off")
        browser.has("3 in flight")
        card = browser.card("cf3")
        wait_for(lambda: "taking off" not in browser.text(card), "cf3 at its height")
        browser.press("None")
        browser.choose("cf2")
        browser.click_floor(0.9, -1.0)
        browser.press("Go")
        # Long enough for a trail that is seen; there is nothing to wait for.
        time.sleep(2.0)
        driver.save_screenshot(str(file))
        browser.press("All")
        browser.press("Land")
        browser.has("0 in flight")


def main() -> None:
    """Launch the example with the page, draw, and end it."""
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE
    port, master = free_port(socket.SOCK_STREAM), free_port(socket.SOCK_STREAM)
    environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{master}"}
    commands = (
        [
            "roslaunch",
            "-p",
            str(master),
            "crazyflie_examples",
            "sw_swarm.launch",
            "n:=3",
            "rviz:=false",
        ],
        ["roslaunch", "-p", str(master), "--wait", "crazyflie_dashboard", "dashboard.launch"],
    )
    commands[1].append(f"port:={port}")
    started = [subprocess.Popen(command, env=environment) for command in commands]
    try:
        draw(port, file)
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(30)


if __name__ == "__main__":
    main()
