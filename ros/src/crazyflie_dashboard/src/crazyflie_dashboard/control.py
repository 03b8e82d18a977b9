"""Control of the vehicles, which one open page has at a time."""

import itertools
import math
import threading
import time
from collections.abc import Callable

from crazyflie_utils.refusal import RefusalError

#: Time within which a page that is loaded again has its control back (s).
RECLAIM_TIME = 30.0


class PageControl:
    """Pages that are open, and the one that has control. For any thread.

    A page that is loaded again, or has lost its connection, is a new page. It has the control that
    the former one of its tab had, if no page has taken it and `RECLAIM_TIME` is not over. Nothing
    else changes when a page closes.
    ``clock()`` is in s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        #: Called when a page has opened or closed.
        self.on_change: Callable[[], None] = lambda: None
        #: Called with a text when another page has control.
        self.log: Callable[[str], None] = lambda text: None
        self._lock = threading.RLock()
        self._numbers = itertools.count(1)
        self._tell: dict[int, Callable[[str], None]] = {}
        self._controller: int | None = None
        self._clock = clock
        self._tabs: dict[int, str] = {}
        self._left = ("", -math.inf)  # Tab of the page that has closed with control, and when (s).

    def open(self, tell: Callable[[str], None], tab: str = "") -> int:
        """Add a page of a tab, if that is known; return its number.

        ``tell(text)`` is called, from any thread, when another page takes or gives up control.
        """
        with self._lock:
            page = next(self._numbers)
            self._tell[page], self._tabs[page] = tell, tab
            left, at = self._left
            is_back = tab and tab == left and self._clock() - at <= RECLAIM_TIME
            if is_back and self._controller is None:
                self.take(page)
        self.on_change()
        return page

    def close(self, page: int) -> None:
        """Remove a page, and its control with it."""
        with self._lock:
            has_control = self._controller == page
            self.release(page)
            tab = self._tabs.pop(page, "")
            if has_control:
                self._left = (tab, self._clock())
            if self._tell.pop(page, None) is None:
                return
        self.on_change()

    def take(self, page: int, is_confirmed: bool = False) -> None:
        """Give a page control; all pages are notified.

        `RefusalError`: another page has control, and the operator has not confirmed that it is
        taken over.
        """
        with self._lock:
            self.expect_open(page)
            before = self._controller
            if before not in (None, page) and not is_confirmed:
                raise RefusalError(
                    f"page {before} has control; you can take it over, and both pages will say so"
                )
            self._controller, self._left = page, ("", -math.inf)
        if before == page:
            return
        if before is not None:
            self._say(before, f"page {page} has taken over control: this page can only watch now")
            self._say(page, f"this page has taken over control from page {before}")
        self._announce(f"page {page} has control", {page, before})

    def release(self, page: int) -> None:
        """Give up control, if the page has it."""
        with self._lock:
            if self._controller != page:
                return
            self._controller = None
        self._announce(f"page {page} has given up control: no page has it", {page})

    def expect_control(self, page: int) -> None:
        """Raise `RefusalError` unless a page has control."""
        with self._lock:
            self.expect_open(page)
            if self._controller != page:
                has = "no page" if self._controller is None else f"page {self._controller}"
                raise RefusalError(f"this page can only watch: {has} has control; take it first")

    @property
    def controller(self) -> int | None:
        """Number of the page that has control."""
        return self._controller

    @property
    def pages(self) -> tuple[int, ...]:
        """Numbers of the pages that are open."""
        with self._lock:
            return tuple(self._tell)

    def expect_open(self, page: int) -> None:
        """Raise `RefusalError` unless a page is open."""
        if page not in self._tell:
            raise RefusalError(f"page {page} is closed; load it again")

    def _announce(self, text, excluding):
        self.log(text)
        for page in self.pages:
            if page not in excluding:
                self._say(page, text)

    def _say(self, page, text):
        # The page may have closed meanwhile.
        if (tell := self._tell.get(page)) is not None:
            tell(text)
