"""The command monte_carlo: settings in, table and figure out."""

import argparse
import os
import shutil
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from rospkg import RosPack
from tqdm import tqdm

from crazyflie_batch.code_version import OtherFlightsError
from crazyflie_batch.monte_carlo import Results, run
from crazyflie_batch.report import findings, table, write_csv
from crazyflie_batch.settings import read_settings
from crazyflie_utils import ParameterError
from crazyflie_utils.text_file import user_path

SCHEDULER_LIMIT = 10.0  #: Longest time to connect to a scheduler, and to its workers, s.

_DESCRIPTION = """
Fly a vehicle many times with parameters drawn at random. Report how many flights stay within
limits, the worst flight, and the sensitivity to each parameter.
"""


class SchedulerError(Exception):
    """There is no scheduler, it has no workers, or these cannot fly."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit status: 0, 1 if it cannot fly, 2 for usage."""
    options = _parser().parse_args(arguments)
    try:
        settings = read_settings(options.settings)
        folder = user_path(options.out or settings.name)
        if options.restart:
            shutil.rmtree(folder / "chunks", ignore_errors=True)
            (folder / "settings.json").unlink(missing_ok=True)
        try:
            results = Results(folder, settings)
        except OSError as error:
            raise OSError(
                f"--out is {folder}: {error.strerror}; expected a folder that can be written"
            ) from None
        with _executor(options.scheduler) as executor:
            _fly(settings, results, executor)
        found = findings(settings, results.outcomes())
        text = table(found)
        (folder / "report.txt").write_text(text + "\n", encoding="utf-8")
        write_csv(found, folder / "flights.csv")
        # Imported here, since importing matplotlib takes long: errors are reported first.
        from crazyflie_batch.figure import save_figure

        save_figure(found, folder / "figure.png")
    except (ParameterError, OtherFlightsError, SchedulerError, OSError) as error:
        print(f"monte_carlo: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("monte_carlo: interrupted; the same command continues from here", file=sys.stderr)
        return 130
    print(text)
    print(f"\nwrote report.txt, flights.csv and figure.png in {folder}")
    return 0


def _parser():
    parser = argparse.ArgumentParser(prog="monte_carlo", description=_DESCRIPTION)
    shipped = Path(RosPack().get_path("crazyflie_batch"), "config", "monte_carlo.yaml")
    parser.add_argument(
        "settings", nargs="?", default=str(shipped), metavar="SETTINGS.yaml", help="(%(default)s)"
    )
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        help="folder of the results; an interrupted run continues there (default: the settings' "
        "name)",
    )
    parser.add_argument(
        "--restart", action="store_true", help="delete the flights that are in the folder"
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="scheduler of dask.distributed, such as tcp://10.0.0.1:8786; its workers run in a "
        "sourced workspace (default: the processors of this machine)",
    )
    return parser


def _fly(settings, results, executor):
    flights, done = settings.run.flights, results.flown()
    if done:
        print(f"{done} of {flights} flights are there already", file=sys.stderr)
    with tqdm(total=flights, initial=done, unit="flight") as bar:
        run(settings, results, executor, bar.update)


@contextmanager
def _executor(address: str | None) -> Iterator[Executor]:
    if address is None:
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as threads:
            yield threads
        return
    # Imported here, since it takes as long to import as all the rest.
    from distributed import Client

    try:
        # A client with an invalid address reports another error when the process ends.
        if ":" not in address:
            raise ValueError("that is not an address")
        client = Client(address, timeout=SCHEDULER_LIMIT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SchedulerError(
            f"no scheduler at {address}: {error}; expected a dask scheduler that runs, such as "
            "tcp://10.0.0.1:8786"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=SCHEDULER_LIMIT)
        except TimeoutError:
            raise SchedulerError(
                f"the scheduler at {address} has no workers; expected at least one, started in a "
                f"sourced workspace: dask worker {address}"
            ) from None
        try:
            yield client.get_executor()
        except OSError:
            raise
        except Exception as error:
            raise SchedulerError(
                f"the workers of {address} have failed: {error!r}; expected workers in shells with "
                "this version of the workspace sourced"
            ) from error
