"""The examples that cflib brings along fly the virtual vehicle with only the address changed.

They are run from where pip has installed them, all at once, each with vehicles of its own.
"""

import concurrent.futures
import contextlib
import importlib.util
import os
import pathlib
import re
import subprocess
import sys
import threading
from typing import Any, NamedTuple

import pytest

from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.testing import virtual_vehicle

#: Time limit of an example (s); the longest takes 52 on a machine that does nothing else.
LIMIT = 300.0


class Expected(NamedTuple):
    """Output of an example (regular expressions), and its effect."""

    output: tuple[str, ...] = ()
    peak: tuple[float, float] = (0.0, 0.0)  #: Range of the vehicle's greatest height (m).
    end: tuple[float, float] | None = None  #: Where it is at the end, x and y (m).


# The methods of cflib that they call are tested in test_cflib.py.
pytestmark = pytest.mark.long

RUNNING = {
    "autonomy/autonomous_sequence.py": Expected(
        (r"take off at 0\.4", r"Setting position \(0\.0, 0\.0, 0\.0, 0\)"), (1.15, 1.4), (0.0, 0.0)
    ),
    "autonomy/autonomous_sequence_high_level.py": Expected(
        (r"is 7\.3 seconds long", r"success!"), (0.95, 1.15), (0.0, 0.0)
    ),
    "autonomy/motion_commander_demo.py": Expected((r"(Doing other work\n){5}",), (0.6, 1.1)),
    "lighthouse/upload_geos.py": Expected(),
    "logging/basiclog.py": Expected((r"(\[\d+\]\[Stabilizer\].*pm\.vbat: 4\.1.*\n){40}",)),
    "logging/basiclog_sync.py": Expected((r"(\[\d+\].*'stabilizer\.yaw'.*\n){900}",)),
    "parameters/basicparam.py": Expected(
        (
            r"has 1024kb of flash",
            r"fetched all parameter values",
            r"Read back: pid_attitude\.pitch_kd=0\.1234",
        )
    ),
    "parameters/persistent_params.py": Expected(
        (
            r"Persisted ring\.effect!",
            r"ring\.effect: .*is_stored=True, default_value=6, stored_value=10",
            r"Cleared ring\.effect!",
        )
    ),
    "parameters/persistent_params_from_file.py": Expected((r"stored activeMarker\.back!",)),
    "step-by-step/sbs_connect_log_param.py": Expected(
        (r"estimator set at number: 2\n", r"estimator set at number: 1\n")
    ),
    "step-by-step/sbs_motion_commander.py": Expected(
        (r"Deck is attached!",), (0.45, 0.65), (0.0, 0.0)
    ),
    "step-by-step/sbs_swarm.py": Expected((r"Light check done", r"Estimators have been reset")),
}

OTHERS = {
    "lighthouse/multi_bs_geometry_estimation.py": "asks for lighthouse base stations, and its user",
}
"""Example -> why it is not run."""

SWARM = "step-by-step/sbs_swarm.py"
SWARM_SIZE = 4
SWARM_PEAK = (0.95, 1.15)

# Addresses and files that stand in the text; the others take CFLIB_URI.
_RADIO = re.compile(r"'radio://[^']*'")
_GEOMETRY_FILE = "/path/to/your/geo.yaml"
_GEOMETRY = """
type: lighthouse_system_configuration
version: '1'
systemType: 2
geos:
  0:
    origin: [1.0, 2.0, 3.0]
    rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
"""


class Run(NamedTuple):
    """Result of an example: for each vehicle the greatest height and the last position."""

    code: int | None
    output: str
    peaks: list[float]
    ends: list[tuple[float, float, float]]


def folder() -> pathlib.Path:
    """Return the folder of the examples, next to cflib."""
    cflib = importlib.util.find_spec("cflib")
    assert cflib is not None and cflib.origin is not None
    return pathlib.Path(cflib.origin).parent.parent / "examples"


def run_example(name: str, place: pathlib.Path) -> Run:
    """Run an example in a folder of its own."""
    place.mkdir(parents=True)
    with contextlib.ExitStack() as stack:
        pairs = [
            stack.enter_context(virtual_vehicle())
            for _ in range(SWARM_SIZE if name == SWARM else 1)
        ]
        servers, uris = [server for server, _ in pairs], [uri for _, uri in pairs]
        geometry = place / "geometry.yaml"
        geometry.write_text(_GEOMETRY)
        text = (folder() / name).read_text().replace(_GEOMETRY_FILE, str(geometry))
        left = iter(uris)
        script = place / "example.py"
        if "uri_from_env" not in text:
            text = _RADIO.sub(lambda _: repr(next(left)), text)
            script.write_text(text)
        else:
            script = folder() / name
        peaks = [0.0] * len(servers)
        is_over = threading.Event()

        def watch():
            while not is_over.wait(0.02):
                for i, server in enumerate(servers):
                    peaks[i] = max(peaks[i], server.vehicle.physics.position[2])

        watcher = threading.Thread(target=watch)
        watcher.start()
        try:
            done = subprocess.run(
                [sys.executable, "-u", str(script)],
                cwd=place,
                env={**os.environ, "CFLIB_URI": uris[0]},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=LIMIT,
            )
            code, output = done.returncode, done.stdout
        except subprocess.TimeoutExpired as error:
            code, output = None, _text(error.stdout)
        # A vehicle that was landed at the last moment must come to rest, which the test checks.
        with contextlib.suppress(AssertionError):
            wait_until(lambda: all(s.vehicle.physics.position[2] == 0.0 for s in servers))
        is_over.set()
        watcher.join()
        ends = [server.vehicle.physics.position for server in servers]
        return Run(code, output, peaks, ends)


def _text(output: Any) -> str:
    return output.decode("utf-8", "replace") if isinstance(output, bytes) else output or ""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return what came of each example, of all that run."""
    place = tmp_path_factory.mktemp("examples")
    # The longest first; more at once than there are processors, as they mostly sleep.
    with concurrent.futures.ThreadPoolExecutor(len(RUNNING)) as pool:
        futures = {name: pool.submit(run_example, name, place / name) for name in RUNNING}
    return {name: future.result() for name, future in futures.items()}


def test_the_tables_name_all_examples():
    present = {str(path.relative_to(folder())) for path in folder().rglob("*.py")}
    assert present == set(RUNNING) | set(OTHERS)


@pytest.mark.parametrize("name", RUNNING)
def test_example(runs, name):
    run, expected = runs[name], RUNNING[name]
    assert run.code == 0, f"{'timed out' if run.code is None else run.code}\n{run.output[-3000:]}"
    for pattern in expected.output:
        assert re.search(pattern, run.output), f"no {pattern} in\n{run.output[-3000:]}"
    low, high = SWARM_PEAK if name == SWARM else expected.peak
    for peak, end in zip(run.peaks, run.ends, strict=True):
        assert low <= peak <= high
        assert end[2] == 0.0
        if expected.end is not None:
            assert end[:2] == pytest.approx(expected.end, abs=0.15)
