#!/usr/bin/env python3
"""Print the load of a page that shows many vehicles for a while: it must not grow or slow down.

Usage: many_vehicles.py [VEHICLES [MINUTES]]
"""

import math
import resource
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))

from fake_dashboard import vehicle
from pages import Browser, Server, chromium

#: Counts frames a second, all of them drawn, and the memory of the page's JavaScript, MiB.
FRAMES = """
const done = arguments[0], start = performance.now();
const scene = getElement(document.querySelector(".scene").id.slice(1));
let count = 0;
(function frame() {
  const time = performance.now() - start;
  if (time < 5000) {
    count++;
    scene.isOld = true;  // Also where nothing moves.
    requestAnimationFrame(frame);
  } else {
    gc();
    done([1000 * count / time, performance.memory.usedJSHeapSize / 2 ** 20]);
  }
})();
"""


def fly(server: Server, count: int, is_over: threading.Event) -> None:
    """Move vehicles on circles, 20 times a second."""
    names = [f"cf{k}" for k in range(1, count + 1)]
    fleet = [vehicle(name, 0.0, is_in_flight=True, state="hovering") for name in names]
    while not is_over.wait(0.05):
        now = time.monotonic()
        places = [
            (k % 10 - 4.5 + 0.3 * math.cos(now + k), k // 10 - 4.5 + 0.3 * math.sin(now + k), 1.0)
            for k in range(count)
        ]
        moved = (replace(each, position=place) for each, place in zip(fleet, places, strict=True))
        server.dashboard.set_vehicles(*moved)


def measure(browser: Browser) -> tuple[float, float, float, float]:
    """Return frames a second, MiB of JavaScript, share of a core of this process, its MiB."""
    before, start = time.process_time(), time.monotonic()
    frames, heap = browser.driver.execute_async_script(FRAMES)
    share = (time.process_time() - before) / (time.monotonic() - start)
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return frames, heap, share, pages * resource.getpagesize() / 2**20


def main() -> None:
    """Measure every minute."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    minutes = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    server, is_over = Server(), threading.Event()
    with chromium("--js-flags=--expose-gc") as driver:
        driver.set_script_timeout(60)
        browser = Browser(driver, server.url)
        server.dashboard.set_vehicles()
        browser.open()
        print("vehicles  minute  frames/s  JavaScript MiB  share of a core  server MiB")
        frames, heap, share, memory = measure(browser)
        print(f"{0:8} {0:7} {frames:9.1f} {heap:15.1f} {share:16.3f} {memory:11.1f}", flush=True)
        threading.Thread(target=fly, args=(server, count, is_over), daemon=True).start()
        browser.has(f"{count} vehicles")
        start = time.monotonic()
        while (now := (time.monotonic() - start) / 60) < minutes:
            frames, heap, share, memory = measure(browser)
            row = f"{count:8} {now:7.1f} {frames:9.1f} {heap:15.1f} {share:16.3f} {memory:11.1f}"
            print(row, flush=True)
            time.sleep(min(60.0, 15 * minutes))
    is_over.set()
    server.page.close()


if __name__ == "__main__":
    main()
