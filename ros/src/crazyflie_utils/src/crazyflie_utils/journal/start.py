"""Begins the journal of a process, if its environment asks for one.

`SWITCH` is the folder of the journals, or "true" for that of the log files; `MINUTES` is how many
are kept.
"""

import os
import re
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

from crazyflie_utils.journal.journal_file import SUFFIX, JournalError, JournalWriter
from crazyflie_utils.journal.recording import Recorder

SWITCH = "CRAZYFLIE_JOURNAL"  #: As in `main`, which loads this module if it is set.
MINUTES = "CRAZYFLIE_JOURNAL_MINUTES"
_DEFAULT_MINUTES = 10.0


def begin_journal(
    node: str,
    program: str,
    clock: str,
    log_folder: str,
    warn: Callable[[str], None],
    **more: Any,
) -> Recorder | None:
    """Return the recorder of a process; None if its journal cannot be written, with a warning.

    ``node`` is the absolute name of the process's node, ``program`` the class of a node or the
    function that makes the nodes, "package.module:name"; ``clock`` is "steady" or "simulated".
    """
    asked = os.environ[SWITCH]
    folder = Path(log_folder if asked.lower() in ("1", "true", "yes") else asked).expanduser()
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", node.strip("/")) or "node"
    began = datetime.now().strftime("%Y%m%d_%H%M%S")
    path = folder / f"{name}_{began}_{os.getpid()}{SUFFIX}"
    try:
        minutes = float(os.environ.get(MINUTES, _DEFAULT_MINUTES))
        writer = JournalWriter(
            path,
            {
                "node": node,
                "program": program,
                "clock": clock,
                "began": datetime.now().astimezone().isoformat(timespec="seconds"),
                "us": time.monotonic_ns() // 1000,
                **more,
            },
            60.0 * minutes,
            warn,
        )
    except ValueError:
        warn(f"{MINUTES} is {os.environ[MINUTES]!r}; expected minutes. No journal is written")
        return None
    except JournalError as error:
        warn(str(error))
        return None
    return Recorder(writer)
