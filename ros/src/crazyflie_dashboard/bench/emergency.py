"""Print how long it takes from Escape, pressed twice in the page, until the motors are off.

Three simulated vehicles take off before each measurement, in the time of the machine's clock.

Usage: emergency.py
"""

import contextlib
import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rosgraph

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))

from pages import Browser, Server, chromium, wait_for
from selenium.webdriver.common.keys import Keys

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.emergency import EmergencyLane
from crazyflie_dashboard.master import Master
from crazyflie_dashboard.page_data import Command
from crazyflie_dashboard.snapshot import Action
from crazyflie_msgs.msg import FilterStatus
from crazyflie_utils.main import begin_script
from crazyflie_utils.testing.programs import free_port, running

NAMES = ("cf1", "cf2", "cf3")
#: Stores the time at which Escape was last pressed (s of the machine's clock).
PRESSED = """addEventListener("keydown", (event) => {
  if (event.key === "Escape") window.pressed = Date.now() / 1000;
}, true)"""


class Bench:
    """The vehicles, a dashboard, and a browser with its page."""

    def __init__(self, driver: Any) -> None:
        self.process, self.end = begin_script("emergency")
        handle = self.process.handle("/dashboard")
        master = Master("/dashboard")
        lane = EmergencyLane(master, handle.warn)
        self.dashboard = Dashboard(handle, master, lane, [])
        self.stopped: dict[str, float] = {}
        for name in NAMES:
            handle.subscribe(
                f"/{name}/in_flight_filter_status", FilterStatus, lambda m, n=name: self._note(n, m)
            )
        self.process.start()
        self.server = Server(self.dashboard)
        self.browser = Browser(driver, self.server.url)
        # Handlers of the vehicles, like those of an operator with another page.
        self.page = self.dashboard.pages.open(str)

    def _note(self, name, message):
        if message.state == FilterStatus.EMERGENCY:
            self.stopped.setdefault(name, time.time())
        else:
            self.stopped.pop(name, None)

    def fly(self) -> None:
        """Bring all vehicles into the air, whatever the state before."""
        self.dashboard.pages.take_over(self.page)
        wait_for(self._is_up, "a takeoff")

    def _is_up(self):
        now = self.dashboard.scene().vehicles
        if len(now) < len(NAMES) or any(each.is_stale for each in now.values()):
            return False
        is_stopped = any(each.is_emergency for each in now.values())
        command = Command(Action.RESET if is_stopped else Action.TAKEOFF, NAMES, time.monotonic())
        outcomes = self.dashboard.command(self.page, command).result(30.0)
        time.sleep(1.0)
        return not is_stopped and not any(each.text for each in outcomes)

    def measure(self, prepare: Callable[[], None]) -> float:
        """Return the time until the last vehicle's motors are off, s."""
        self.fly()
        prepare()
        self.browser.driver.execute_script(PRESSED)
        self.browser.type(Keys.ESCAPE, Keys.ESCAPE)
        wait_for(lambda: len(self.stopped) == len(NAMES), "motors off")
        return max(self.stopped.values()) - self.browser.driver.execute_script("return pressed")


def main() -> None:
    """Measure in each situation, the master's end last."""
    port = free_port(socket.SOCK_STREAM)
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    # roslaunch ends with its own master, and goes on without another one.
    with contextlib.ExitStack() as stack:
        process = stack.enter_context(running("rosmaster", "--core", "-p", port))
        wait_for(rosgraph.is_master_online, "the master")
        fleet = ("roslaunch", "crazyflie_examples", "sw_swarm.launch", "n:=3", "rviz:=false")
        stack.enter_context(running(*fleet))
        driver = stack.enter_context(chromium(scale=0.5))
        bench = Bench(driver)
        browser, master = bench.browser, process.pid
        browser.open()

        def open_dialog():
            browser.press("Take control")
            browser.has("Take over")

        def end_master():
            os.kill(master, signal.SIGKILL)
            driver.get(bench.server.url)

        situations: dict[str, Callable[[], None]] = {
            "the page is open": lambda: None,
            "a dialog is open": open_dialog,
            "right after loading": lambda: driver.get(bench.server.url),
            "the master is stopped": lambda: os.kill(master, signal.SIGSTOP),
            "the master is dead, right after loading": end_master,
        }
        for name, prepare in situations.items():
            print(f"{name:42} {bench.measure(prepare) * 1e3:6.0f} ms", flush=True)
            if "stopped" in name:
                os.kill(master, signal.SIGCONT)
        bench.dashboard.close()
        bench.server.page.close()
        bench.end()


if __name__ == "__main__":
    main()
