"""Flies the software example for hours while things go wrong, and watches what has to hold.

The nodes and their parameters are those of sw_hover.launch, each node in a fake process of
its own, so that it can be killed and frozen; time is moved by hand, as fast as possible. Run
``python3 -m crazyflie_dev.soak --duration 3600 --seed 1``.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from random import Random
from typing import Any

import rospkg
from std_srvs.srv import EmptyRequest
from tqdm import tqdm

from crazyflie_dashboard.page_data import MAX_COMMAND_AGE
from crazyflie_dashboard.snapshot import Action
from crazyflie_dev.soak_faults import (
    FAULTS,
    MISSION_PARAMETERS,
    MISSIONS,
    Fault,
    SoakFlight,
)
from crazyflie_dev.soak_page import NAME, PageNode
from crazyflie_dev.soak_watch import Watch
from crazyflie_msgs.msg import PositionVelocityStateStamped
from crazyflie_utils.journal.journal_file import SUFFIX, JournalWriter
from crazyflie_utils.journal.recording import Recorder
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.testing.launch_files import composed_nodes, expand

HOVER_HEIGHT = 1.0  #: Hover height of the launch file (m).
_STEP = 0.05  #: Between two looks of the operator at the flight, s.
_TIMEOUT = 30.0  #: Longest wait for the reply to a call, or for the vehicle to come to rest, s.

_PAGE_SHARE = 0.25  #: Share of the flights that are commanded by the dashboard's page.
_LOADING_TIME = 2.5  #: Time from loading the page until it shows the vehicle (s).
_LAGS = (0.0, 0.5, 3.0)  #: Lags of the page from a click to its command (s).

_SIMULATOR = "/simulator"

#: A vehicle that comes to rest further away than this is carried back to the middle, m.
_STRAY = 1.5


class Soak:
    """Flights one after the other, with a fault in each.

    ``seed`` decides the faults and everything else that is random; ``journals`` is the folder of a
    journal of each process, if there are to be any; the other arguments are those of
    sw_hover.launch.
    """

    def __init__(self, seed: int, journals: Path | None = None, **arguments: object):
        package = Path(rospkg.RosPack().get_path("crazyflie_examples"))
        given = {"composed": True, "rviz": False, "simulator_dt": 0.005, **arguments}
        _, parameters = expand(package / "launch/sw_hover.launch", **given)
        nodes = composed_nodes(parameters)
        for mission in MISSIONS:
            nodes[mission.strip("/")] = "crazyflie_fleet.high_level_node:HighLevelNode"
            parameters |= {f"{mission}/{key}": name for key, name in MISSION_PARAMETERS.items()}
        self._classes = {f"/{name}": node for name, node in NODE_CLASSES(nodes).items()}
        # Far from the beginning of time: the wall clock is set back, too.
        self._journals, self._count = journals, 0
        self.graph = FakeGraph({**parameters, "/simulator/seed": seed}, 1e6, self._recorder)
        self.random = Random(seed)
        self.watch = Watch(self.graph)
        self.faults: Counter[str] = Counter()  #: Fault -> how often.
        #: Number of takeoffs that were refused, and of those that were not.
        self.refused = self.answered = 0
        self.page = PageNode(self.graph)
        self.clicked = 0  #: Flights that were commanded by the page.
        self._flight = SoakFlight(self.graph, self.random, self.start)
        self._fault_steps: Iterator[None] = iter(())
        self._is_over = True
        self.watch.begin()
        for name in self._classes:
            self.start(name)
        self.graph.start(NAME, self.page)
        self.graph.advance(2.0)

    def _recorder(self, name, start):
        # The page is made with the graph, not by a class alone.
        if self._journals is None or name == NAME:
            return None
        self._count += 1
        path = self._journals / f"{self._count:05d}_{name.strip('/')}{SUFFIX}"
        began = time.monotonic_ns() // 1000
        header = {"node": name, "program": "", "clock": "manual", "us": began, "start": start}
        return Recorder(JournalWriter(path, header, math.inf, print))

    def start(self, name: str) -> None:
        """Start a node's process, unless it is alive."""
        if not self.graph.is_alive(name):
            self.graph.start(name, self._classes[name]())

    def fly(self, fault: Fault) -> None:
        """Take off, refer, land; let ``fault`` happen at some moment of it."""
        self.watch.renew()
        self.faults[fault.name] += 1
        self._fault_steps, self._is_over = self._happen(fault), False
        self.watch.may_fly = True
        self.watch.allow(HOVER_HEIGHT)
        by_page = self.random.random() < _PAGE_SHARE and self._open_page()
        takeoff = self._click(Action.TAKEOFF) if by_page else self._call("/takeoff")
        if takeoff.done():
            reason = takeoff.exception()
            self.refused += reason is not None
            self.answered += reason is None
            # Faults of the previous flight are over; a second publisher is remembered for 5 s.
            is_good = not self.watch.is_calm or reason is None or "two nodes" in str(reason)
            self.watch.check(is_good, f"refused without a fault: {reason}")
        for _ in range(self.random.randint(0, 3)):
            self._refer(self.random.uniform(-1, 1), self.random.uniform(-1, 1))
            self._wait(self.random.uniform(0.5, 2.5))
        if by_page:
            self.page.load()
            self._click(Action.LAND)
            self.page.close()
        else:
            self._call("/land")
        # Remaining faults happen on the ground.
        while not self._is_over:
            self._wait(_STEP)
        self._come_to_rest()

    def _happen(self, fault):
        """Wait for the moment of a fault, and let it last, a step at a time."""
        begin = self.graph.time + self.random.uniform(0.0, 18.0)
        while self.graph.time < begin:
            yield
        watch = self.watch
        watch.is_calm = False
        watch.is_blind, watch.may_fall, watch.is_starved = fault.blinds, fault.drops, fault.starves
        watch.allow(fault.height)
        steps = fault.run(self._flight)
        end = self.graph.time + self.random.uniform(fault.shortest, fault.longest)
        while self.graph.time < end:
            next(steps)
            watch.is_emergency = fault.is_emergency
            yield
        watch.is_blind = watch.is_emergency = False
        steps.close()
        self._is_over = True

    def _refer(self, x, y):
        height = self.random.uniform(0.6, 1.4)
        self.watch.allow(height)
        message = PositionVelocityStateStamped()
        message.header.stamp = self.graph.stamp()
        message.state.x, message.state.y, message.state.z = x, y, height
        self.graph.publish("/ref", message)

    def _open_page(self):
        """Load the page; return whether it shows the vehicle, as it does not without poses."""
        self.page.load()
        self._wait(_LOADING_TIME)
        if not self.page.sees_vehicle:
            self.page.close()
            return False
        self.clicked += 1
        return True

    def _click(self, action):
        """Command the vehicle by the page; a click that has lagged too long moves nothing."""
        lag = self.random.choice(_LAGS)
        outcome = self._await(self.page.click(action, lag))
        if lag > MAX_COMMAND_AGE:
            text = str(outcome.exception()) if outcome.done() else "no answer"
            self.watch.check("s old" in text, f"a click {lag:g} s ago: {text}")
            outcome = self._await(self.page.click(action, 0.0))
        return outcome

    def _call(self, service):
        return self._await(self.graph.call(service, EmptyRequest()))

    def _await(self, outcome: Future[Any]) -> Future[Any]:
        end = self.graph.time + _TIMEOUT
        # A server that is killed never answers.
        while (
            not outcome.done() and self.graph.time < end and self.graph.is_alive("/takeoff_server")
        ):
            self._wait(_STEP)
        return outcome

    def _come_to_rest(self):
        watch, end = self.watch, self.graph.time + _TIMEOUT
        while watch.height > 0.01 or watch.state != "on_ground":
            self._wait(0.5)
            if watch.state == "flying":
                self._call("/land")
            if self.graph.time > end:
                watch.check(False, f"not at rest: {watch.state}, {watch.height:.2f} m")
                break
        # Refused within 2 s of an emergency, and without one.
        self._wait(2.0)
        self.graph.call("/emergency_reset", EmptyRequest())
        self._wait(1.0)
        watch.may_fly = watch.may_fall = False
        # Nothing may begin by itself now.
        self._wait(2.0)
        if watch.distance > _STRAY:
            # A simulator that starts again has its vehicle where the launch file puts it.
            self.graph.kill(_SIMULATOR)
            watch.carried()
            self.start(_SIMULATOR)
            self._wait(2.0)

    def _wait(self, duration):
        end = self.graph.time + duration
        while self.graph.time < end - 1e-9:
            next(self._fault_steps, None)
            self.graph.advance(min(_STEP, end - self.graph.time))


def soak(
    duration: float,
    seed: int,
    progress: bool = False,
    journals: Path | None = None,
    **arguments: object,
) -> dict[str, Any]:
    """Fly for ``duration`` (s, simulated) and return what was seen, as JSON knows it.

    ``progress`` shows a bar on the terminal; see `Soak` for the other arguments.
    """
    began = time.monotonic()
    run = Soak(seed, journals, **arguments)
    start = run.graph.time
    faults: list[Fault] = []
    with tqdm(total=round(duration), unit="s", disable=not progress) as bar:
        while run.graph.time - start < duration:
            before = len(run.watch.violations)
            # Each fault once, in a new order, before any comes again.
            faults = faults or run.random.sample(FAULTS, len(FAULTS))
            fault = faults.pop()
            run.fly(fault)
            new = run.watch.violations[before:]
            run.watch.violations[before:] = [f"{fault.name}: {each}" for each in new]
            bar.update(round(run.graph.time - start) - bar.n)
    flown = run.graph.time - start
    run.graph.end_journals()
    return {
        "seed": seed,
        "arguments": {name: str(value) for name, value in arguments.items()},
        "simulated, s": round(flown, 1),
        "times real time": round(flown / (time.monotonic() - began), 1),
        "takeoffs answered, refused": [run.answered, run.refused],
        "flights by the page": run.clicked,
        "faults": dict(sorted(run.faults.items())),
        "highest above reference, m": round(run.watch.highest, 3),
        "farthest from start, m": round(run.watch.farthest, 3),
        "hardest landing, m/s": round(run.watch.hardest, 2),
        "errors logged": sum(level in ("error", "fatal") for level, _ in run.graph.log),
        "violations": run.watch.violations,
    }


def main() -> int:
    """Run a soak; print what was seen; exit with 1 when anything did not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=3600.0, help="s, simulated")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dynamics", default="near_hover", help="of sw_hover.launch")
    parser.add_argument("--output", type=Path, help="JSON file")
    parser.add_argument("--journals", type=Path, help="folder of journals, for ./run replay")
    options = parser.parse_args()
    result = soak(
        options.duration,
        options.seed,
        progress=True,
        journals=options.journals,
        dynamics=options.dynamics,
    )
    text = json.dumps(result, indent=2)
    print(text)
    if options.output is not None:
        options.output.write_text(text + "\n")
    return 1 if result["violations"] else 0


if __name__ == "__main__":
    sys.exit(main())
