"""Launches simulated vehicles and the page to fly them, until Ctrl-C; shows warnings only."""

import argparse
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from roslaunch.core import RLException
from roslaunch.xmlloader import XmlParseException

from crazyflie_dashboard.access import AccessError, expect_free_port
from crazyflie_fleet import fleet_file
from crazyflie_utils import ParameterError
from crazyflie_utils.launch_file import unknown_arguments
from crazyflie_utils.terminal import copy_output, say, waiting
from crazyflie_utils.text_file import user_path

_DEFAULT_COUNT = 3  #: Number of vehicles.
_PORT = "8642"  #: The page's, by default.
_POLL = 0.1  #: Longest time until a signal, or the page, is noticed (s).
LAUNCHED = ("crazyflie_examples", "sw_swarm.launch")
#: On a computer that is too slow, or too busy, simulated time slows down; real time would be lost.
_OPTIONS = ("rviz:=false", "dashboard:=true", "sim_time:=true")

STEPS = """{n} simulated vehicles, and a page to fly them: {url}
  1. Click "Take control", then "All" and "Take off".
  2. Choose one vehicle, click on the floor, drag the handle to a height, and click "Go".
  3. "All" and "Land". Ctrl-C here ends everything, after a landing.
Warnings follow; all other output is in {log}"""


def vehicles_and_arguments(words: Sequence[str], default: int) -> tuple[list[str], list[str]]:
    """Return the names of the vehicles, and the arguments of sw_swarm.launch.

    Their number is given as ``9`` or ``n:=9``, or by a fleet file; else it is the default.
    ArgumentTypeError: the launch file has no such argument, or a file or folder cannot be read.
    """
    counts = [word.removeprefix("n:=") for word in words if re.match("n:=|(?!.*:=)", word)]
    if len(counts) > 1 or not all(re.fullmatch("[1-9][0-9]*", count) for count in counts):
        raise argparse.ArgumentTypeError(
            f"n is {' '.join(counts)}; expected one number of vehicles, such as 9 or n:=9"
        )
    others = [word for word in words if ":=" in word and not word.startswith("n:=")]
    names = [f"cf{k + 1}" for k in range(int(counts[0]) if counts else default)]
    try:
        problems = unknown_arguments([*LAUNCHED, "dashboard:=true", *others])
        for place, (name, value) in enumerate(word.split(":=", 1) for word in others):
            # Nodes do not run in this folder.
            paths = [user_path(path).absolute() for path in value.split(":") if path]
            if name == "fleet" and paths:
                names = [vehicle.name for vehicle in fleet_file.load(paths[0]).vehicles]
            elif name == "folders":
                missing = [path for path in paths if not path.is_dir()]
                problems += [f"folders: {path} is not a folder" for path in missing]
            else:
                continue
            others[place] = f"{name}:={':'.join(map(str, paths))}"
    except (RLException, XmlParseException, ParameterError) as error:
        problems = [str(error)]
    if problems:
        raise argparse.ArgumentTypeError("; ".join(problems))
    return names, others


def fly(n: int, launch_arguments: list[str], log: Path) -> int:
    """Launch n vehicles and the page until a signal; return the exit status."""
    urls: list[str] = []
    signals: list[int] = []
    is_over = threading.Event()

    def show():
        with waiting(f"starting {n} vehicles and the page"):
            while not (urls or signals or is_over.wait(_POLL)):
                pass
        if urls:
            print(STEPS.format(n=n, url=urls[0], log=log), flush=True)
        while not (signals or is_over.wait(_POLL)):
            pass
        if signals:
            say(f"{signal.Signals(signals[0]).name}: landing, then everything ends")
            with waiting("landing"):
                is_over.wait()

    with subprocess.Popen(
        # In a session of its own: this program passes signals on, whichever way they come.
        ["roslaunch", *LAUNCHED, f"n:={n}", *_OPTIONS, *launch_arguments],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
        start_new_session=True,
    ) as launched:  # fmt: skip
        # It may interrupt whatever has a lock, so it prints nothing.
        def note(number, _):
            signals.append(number)
            launched.send_signal(signal.SIGINT)

        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, note)
        shown = threading.Thread(target=show)
        shown.start()
        assert launched.stdout is not None
        found = re.compile(r"dashboard is at (\S+)")
        copy_output(launched.stdout, log, lambda line: urls.extend(found.findall(line)))
        is_over.set()
        shown.join()
    if not (urls or signals):
        print(f"fly: the launch has ended; see {log}", file=sys.stderr)
        return 1
    return launched.returncode


def main() -> int:
    """Fly by the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="run fly", description=__doc__)
    parser.add_argument(
        "words", nargs="*", metavar="n|NAME:=VALUE",
        help=f"number of vehicles ({_DEFAULT_COUNT}); arguments of sw_swarm.launch, such as "
        "spacing:=1.8, and of the page: port:=8643, folders:=FOLDER",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the log")
    options = parser.parse_intermixed_args()
    try:
        names, launch_arguments = vehicles_and_arguments(options.words, _DEFAULT_COUNT)
        ports = [word.partition(":=")[2] for word in launch_arguments if word.startswith("port:=")]
        expect_free_port("127.0.0.1", int((ports or [_PORT])[-1]))
    except (argparse.ArgumentTypeError, AccessError, ValueError) as error:
        parser.error(str(error))
    options.out.mkdir(parents=True, exist_ok=True)
    return fly(len(names), launch_arguments, options.out / "fly.log")


if __name__ == "__main__":
    sys.exit(main())
