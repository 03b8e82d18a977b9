"""The state of motion capture, for the diagnostics."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from mocap_optitrack.bodies import Body
from mocap_optitrack.frame_times import FrameOrder
from mocap_optitrack.frames import SeenBody

OK, WARN, ERROR = range(3)  #: Levels, as in diagnostic_msgs/DiagnosticStatus.

#: Time after which a missing body is a fault (s): the first moments of a stream have no bodies.
_GRACE = 2.0

#: Largest number of stored bodies that are not configured, so that a message can name them.
_MOST_OTHERS = 10

_TWO_SERVERS = "the server's clock keeps jumping: do two servers send to the same address?"


class Status(NamedTuple):
    """The state of the stream or of a body."""

    component: str  #: Name of the stream or body.
    level: int  #: `OK`, `WARN` or `ERROR`.
    message: str  #: For an operator.
    values: dict[str, str]  #: Figures, with their units in the keys.


class Health:
    """Counts events between two reports; ``now`` is the time at the beginning, s.

    Fewer frames a second than the first of ``rate_limits``, or more than the second, are a fault.
    """

    _longest_gap: float

    def __init__(
        self,
        bodies: Sequence[Body],
        stale_after: float,
        now: float,
        rate_limits: tuple[float, float] | None = None,
    ):
        self._rate_limits = rate_limits or (0.0, math.inf)
        self._bodies = {body.key: _BodyCount(body) for body in bodies}
        self.stale_after = stale_after  #: Largest age of a used frame, s.
        self._silence = "no frames"
        self._begin = now
        self.disconnected("not connected so far")

    def disconnected(self, failure: str) -> None:
        """Record why there is no connection: earlier observations are dropped."""
        self._server: str | None = None
        self._failure = failure
        self._stream_begin = math.inf
        self._last_frame: float | None = None
        self._others: dict[tuple[int | None, str | None], None] = {}
        self._clear_counts()

    def connected(self, server: str) -> None:
        """Record a new connection."""
        self._server = server

    def silent(self, text: str) -> None:
        """Record why a connection has no frames; the next frame ends that."""
        self._silence = text

    def add(self, body: Body) -> None:
        """Also report on a body."""
        self._bodies[body.key] = _BodyCount(body)
        self._others.pop((None, body.key), None)

    def count(self, order: FrameOrder) -> None:
        """Count a frame that is dropped."""
        self._dropped[order] += 1

    def frame(self, now: float, latency: float) -> None:
        """Count a good frame and its latency from exposure to arrival (s)."""
        if self._last_frame is None:
            self._stream_begin = now
        else:
            self._longest_gap = max(self._longest_gap, now - self._last_frame)
        self._last_frame = now
        self._silence = "no frames"
        self._latencies.append(latency)

    def body(self, body: Body, now: float, is_tracked: bool, why: str = "") -> None:
        """Count a configured body in a good frame; ``why`` is the reason if it is not tracked."""
        count = self._bodies[body.key]
        count.why = why
        count.frames += 1
        if is_tracked:
            count.tracked += 1
            count.last = now

    def other(self, body: SeenBody) -> None:
        """Record a `SeenBody` in a good frame that is not configured."""
        if len(self._others) < _MOST_OTHERS:
            self._others[body.body_id, body.name] = None

    def report(self, now: float) -> list[Status]:
        """Return the state of the stream, then of every body, since the last report.

        Counting starts again at ``now`` (s).
        """
        bodies = [self._body_status(count, now) for count in self._bodies.values()]
        statuses = [self._stream_status(now), *bodies]
        self._begin = now
        self._clear_counts()
        return statuses

    def _clear_counts(self) -> None:
        self._latencies: list[float] = []
        self._longest_gap = 0.0
        self._dropped: Counter[FrameOrder] = Counter()
        for count in self._bodies.values():
            count.frames = count.tracked = 0

    def _stream_status(self, now):
        period = now - self._begin
        frames = len(self._latencies)
        rate = frames / period if period > 0.0 else 0.0
        gap = self._longest_gap
        if self._last_frame is not None:
            gap = max(gap, now - self._last_frame)
        values = {
            "server": self._server or "none",
            "rate (Hz)": f"{rate:.1f}",
            "longest gap (ms)": _milliseconds(gap),
            "stale frames": str(self._dropped[FrameOrder.STALE]),
            "repeated frames": str(self._dropped[FrameOrder.OLD]),
            "frames of another clock": str(self._dropped[FrameOrder.FOREIGN]),
        }
        if frames:
            mean = math.fsum(self._latencies) / frames
            values["latency, mean (ms)"] = _milliseconds(mean)
            values["latency, maximum (ms)"] = _milliseconds(max(self._latencies))
        level, message = self._stream_assessment(values, gap, rate)
        return Status("stream", level, message, values)

    def _stream_assessment(self, values, gap, rate):
        dropped = self._dropped
        if self._server is None:
            return ERROR, self._failure
        foreign = dropped[FrameOrder.FOREIGN]
        if dropped[FrameOrder.RESTART] > 1 or foreign > len(self._latencies):
            return ERROR, _TWO_SERVERS
        if not self._latencies:
            if dropped[FrameOrder.LEARNING] or dropped[FrameOrder.RESTART]:
                return WARN, "learning the server's clock"
            if dropped[FrameOrder.STALE]:
                return ERROR, "all frames are stale: is the server paused or playing a recording?"
            return ERROR, self._silence
        if foreign > 1:
            return WARN, _TWO_SERVERS
        if gap > self.stale_after:
            return WARN, f"gaps of up to {values['longest gap (ms)']} ms"
        low, high = self._rate_limits
        is_whole = self._stream_begin <= self._begin
        if is_whole and not low <= rate <= high:
            return WARN, f"{rate:.1f} frames per second; expected {low:g} to {high:g}"
        return OK, (
            f"{values['rate (Hz)']} frames per second, {values['latency, mean (ms)']} ms old"
        )

    def _body_status(self, count, now):
        values = {"frames": str(count.frames), "tracked": str(count.tracked)}
        if math.isfinite(count.last):
            values["last seen (s ago)"] = f"{now - count.last:.2f}"
        level, message = self._body_assessment(count, now)
        return Status(count.body.component, level, message, values)

    def _body_assessment(self, count, now):
        if self._last_frame is None or now - self._last_frame > self.stale_after:
            return ERROR, "no frames"
        is_missing = now - count.last > self.stale_after
        if is_missing and count.why:
            return ERROR, count.why
        if count.last < self._stream_begin:
            level = WARN if now - self._stream_begin < _GRACE else ERROR
            if count.frames:
                return level, "in the stream, but not tracked so far"
            return level, f"not in the stream so far; {self._other_bodies()}"
        if is_missing:
            return ERROR, f"not tracked for {now - count.last:.1f} s"
        if count.tracked < count.frames:
            return WARN, f"tracked in {count.tracked} of {count.frames} frames"
        return OK, "tracked"

    def _other_bodies(self):
        if not self._others:
            return "it shows no others that are not configured"
        return "it shows others that are not configured: " + ", ".join(map(_describe, self._others))


@dataclass
class _BodyCount:
    body: Body
    #: Good frames since the last report, and those of them in which it was tracked.
    frames: int = 0
    tracked: int = 0
    last: float = -math.inf  #: Time at which it was tracked last, s.
    why: str = ""  #: Reason if it is not tracked.


def _describe(number_and_name):
    known = [str(part) for part in number_and_name if part is not None]
    return "{} ({})".format(*known) if len(known) == 2 else "".join(known)


def _milliseconds(seconds):
    return f"{1e3 * seconds:.1f}"
