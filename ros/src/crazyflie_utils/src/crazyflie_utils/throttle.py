"""What keeps a log from being flooded."""

from collections.abc import Hashable

_MOST_KEYS = 64


class Throttle:
    """Lets each key pass once in a period.

    It remembers a bounded number of keys. While it remembers that many, new ones do not pass:
    there is more to be said than anybody reads.
    """

    def __init__(self) -> None:
        self._allowed_from: dict[Hashable, float] = {}

    def passes(self, key: Hashable, period: float, now: float) -> bool:
        """Tell whether ``key`` may pass at ``now`` (s), and not again for ``period`` (s)."""
        if now < self._allowed_from.get(key, now):
            return False
        if key not in self._allowed_from and len(self._allowed_from) >= _MOST_KEYS:
            self._forget(now)
            if len(self._allowed_from) >= _MOST_KEYS:
                return False
        self._allowed_from[key] = now + period
        return True

    def _forget(self, now):
        self._allowed_from = {
            key: moment for key, moment in self._allowed_from.items() if now < moment
        }
