"""The object with which each script of Crazyswarm begins."""

import argparse
import atexit
import logging
import math
import os
from collections.abc import Sequence
from pathlib import Path

from crazyflie_py import fleet
from crazyflie_py.buttons import Input
from crazyflie_py.crazyflie import CrazyflieServer
from crazyflie_py.swarm import Swarm, TimeHelper
from crazyflie_utils.text import number_from_text


def build_argparser(
    parent_parsers: Sequence[argparse.ArgumentParser] = (),
) -> argparse.ArgumentParser:
    """Return the parser of the options that each script has."""
    parser = argparse.ArgumentParser(
        formatter_class=argparse.ArgumentDefaultsHelpFormatter, parents=list(parent_parsers)
    )
    parser.add_argument("--sim", help="fly ideal vehicles, without ROS", action="store_true")
    parser.add_argument(
        "--unchecked", help="carry out unsafe commands with a warning", action="store_true"
    )
    group = parser.add_argument_group("with --sim only")
    add = group.add_argument
    add(
        "--vis",
        help="what draws",
        choices=["mpl", "vispy", "vispy_headless", "null"],
        default="mpl",
    )
    add("--dt", help="period of steps and pictures, s", type=_period, default=0.1)
    add("--writecsv", help="write a CSV file for each vehicle", action="store_true")
    add("--disturbance", help="noise of cmdVelocityWorld, m/s", type=_speed, default=0.0)
    add("--maxvel", help="limit of the speed, m/s", type=_speed, default=math.inf)
    add("--video", help="write a video to this file")
    return parser


def _period(text):
    value = number_from_text(text)
    if not 1e-4 <= value <= 10.0:
        raise argparse.ArgumentTypeError(f"{text}; expected 0.0001 to 10 (s)")
    return value


def _speed(text):
    value = number_from_text(text)
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"{text}; expected a number >= 0 (m/s)")
    return value


class Crazyswarm:
    """All vehicles, their clock, and a button.

    Parameters
    ----------
    crazyflies_yaml : str or Path, optional
        Fleet file, or its text: Crazyswarm's layout or crazyswarm2's. With --sim without it,
        crazyflies.yaml in the folder launch or config next to that of the script; otherwise all
        running vehicles.
    parent_parser : argparse.ArgumentParser, optional
        The script's own options, made with ``add_help=False``.
    args : str or sequence of str, optional
        The command line; that of the script by default. Unknown options are ignored.
    """

    def __init__(
        self,
        crazyflies_yaml: str | Path | None = None,
        parent_parser: argparse.ArgumentParser | None = None,
        args: str | Sequence[str] | None = None,
    ):
        parser = build_argparser([] if parent_parser is None else [parent_parser])
        options, _ = parser.parse_known_args(args.split() if isinstance(args, str) else args)
        # The starting program decides that a script does not fly, whatever options the script has.
        options.sim = options.sim or bool(os.environ.get(fleet.DRY_RUN))
        swarm = _swarm(crazyflies_yaml, options)
        atexit.register(swarm.close)
        self.allcfs = CrazyflieServer(swarm)
        self.timeHelper: TimeHelper = swarm
        self.input = Input(self.timeHelper, options.sim)


def _print_warnings() -> None:
    # With its own handler: rospy replaces those of the root logger.
    log = logging.getLogger("crazyflie_py")
    if not log.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("[%(levelname)s] %(message)s"))
        log.addHandler(handler)


def _swarm(crazyflies_yaml: str | Path | None, options: argparse.Namespace) -> Swarm:
    _print_warnings()
    if options.sim:
        from crazyflie_py.simulation import Simulation

        return Simulation(fleet.load(crazyflies_yaml), options)
    # Imported here, so that scripts with --sim need neither ROS nor the time to import it.
    from crazyflie_py.ros_swarm import RosSwarm

    return RosSwarm(crazyflies_yaml, options)
