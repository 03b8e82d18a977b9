"""Diagnostics of a node, once a second."""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from crazyflie_utils import NodeHandle

PERIOD = 1.0  #: Of the diagnostics, s; REP 107 recommends one report a second.

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def report(
    handle: NodeHandle, level: int, message: str, figures: Mapping[str, str]
) -> DiagnosticArray:
    """Return a report of a node; the units are in the keys of the figures."""
    status = DiagnosticStatus(
        level=level,
        name=handle.name.lstrip("/"),
        message=message,
        values=[KeyValue(key, value) for key, value in figures.items()],
    )
    array = DiagnosticArray(status=[status])
    array.header.stamp = handle.stamp()
    return array
