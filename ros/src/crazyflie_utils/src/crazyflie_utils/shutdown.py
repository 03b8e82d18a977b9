"""The end of a process: signals, flights that are not over, the last messages."""

import logging
import os
import signal
import sys
import threading
import time
from typing import NoReturn

import rospy

from crazyflie_utils.flights import Flights
from crazyflie_utils.node import Node, Process

_SHUTDOWN_LIMIT = 2.0  #: Longest time that shutdown waits for a callback (s).

#: Longest time that a process continues for a flight that is to end (s): less than the 15 s that
#: roslaunch waits.
_FLIGHT_LIMIT = 10.0

#: Time that a process waits for another one to publish that its flight is to end, before it logs
#: that it waits (s).
_NOTICE_DELAY = 1.0

#: Time for rospy's threads to send the last messages, and for subscribers to read them (s): a
#: subscriber disconnects as soon as the master reports the publisher's end.
FLUSH_TIME = 0.2


def catch_signals() -> list[int]:
    """Return a list to which SIGINT and SIGTERM are added from now on.

    Call it before ``rospy.init_node``, whose handlers shut down inside the handler, where
    any lock may be held by the very code that was interrupted.
    """
    caught: list[int] = []
    ends = (signal.SIGINT, signal.SIGTERM)

    def note(number, _frame):
        caught.append(number)
        # After the first signal the process waits for flights; the next one ends that.
        if len(caught) > 1:
            for each in ends:
                signal.signal(each, signal.SIG_DFL)

    for each in ends:
        signal.signal(each, note)
    return caught


class Shutdown:
    """The shutdown of a process with nodes (by absolute name) before rospy closes connections.

    ``signals`` is the list of `catch_signals`.
    """

    def __init__(self, process: Process, nodes: dict[str, Node], signals: list[int]):
        self._process = process
        self._nodes = nodes
        self._signals = signals
        self.is_stuck = False  #: Whether a callback has not returned.
        self.has_ended = threading.Event()  #: Whether `run` is complete.
        needed = [name for name, node in nodes.items() if node.needed_in_flight]
        self._flights = Flights(process.topics, needed) if needed else None

    def run(self) -> None:
        """Stop timers and nodes, and wait until the last messages are sent.

        When another process asks for it (``rosnode kill``, a node with the same name), flights are
        waited for first, in a thread of rospy.
        """
        if not self._signals and self._process.exit_status is None:
            self.wait_for_flights()
        work = threading.Thread(target=self._process.shut_down, args=(self._nodes,), daemon=True)
        work.start()
        work.join(_SHUTDOWN_LIMIT)
        self.is_stuck = work.is_alive()
        if self.is_stuck:
            text = f"a callback has not returned within {_SHUTDOWN_LIMIT:g} s; exiting"
            self._process.transport.log("fatal", text)
        time.sleep(FLUSH_TIME)
        self.has_ended.set()

    def wait_for_flights(self) -> None:
        """Wait, 10 s at most, for flights that need these nodes; another signal ends that."""
        flights = self._flights
        if flights is None or not flights.in_flight:
            return
        # Reset before the log says that another signal ends the wait: one may come at once.
        begin, signals = time.monotonic(), len(self._signals)
        own = self._process.own_flights
        if own:
            self._log_waiting(own)
        # In another thread: a callback may never return.
        prepare = self._process.prepare_shutdown
        threading.Thread(target=prepare, args=(self._nodes,), name="end", daemon=True).start()
        is_logged = bool(own)
        while flights.in_flight and time.monotonic() < begin + _FLIGHT_LIMIT:
            if len(self._signals) > signals:
                return
            time.sleep(0.05)
            if not is_logged and time.monotonic() > begin + _NOTICE_DELAY:
                is_logged = True
                if names := flights.unattended(2.0 * _NOTICE_DELAY):
                    self._log_waiting(names)

    def _log_waiting(self, names):
        self._process.transport.log(
            "warn",
            f"{', '.join(names)}: in flight; ends after the landing, or in {_FLIGHT_LIMIT:g} s; "
            "another signal ends at once",
        )


def fail() -> NoReturn:
    """End a process that cannot start, with status 1."""
    rospy.signal_shutdown("failed to initialize")
    exit_at_once(1)


def exit_at_once(status: int) -> NoReturn:
    """Exit even if threads, of rospy or stuck in a callback, would keep the process alive."""
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
