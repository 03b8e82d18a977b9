"""Control: one page at a time."""

import pytest

from crazyflie_dashboard.control import RECLAIM_TIME, PageControl
from crazyflie_utils.refusal import RefusalError


class Told:
    """Pages and what they were told, at a time that is set."""

    def __init__(self):
        self.now = 0.0
        self.control = PageControl(lambda: self.now)
        self.texts = {}

    def open(self, tab=""):
        texts = []
        page = self.control.open(texts.append, tab)
        self.texts[page] = texts
        return page


@pytest.fixture
def told():
    return Told()


def test_a_new_page_only_looks(told):
    page = told.open()
    with pytest.raises(RefusalError, match="no page has control; take it first"):
        told.control.expect_control(page)


def test_control_is_taken_once(told):
    one, two = told.open(), told.open()
    told.control.take(one)
    told.control.expect_control(one)
    with pytest.raises(RefusalError, match=f"page {one} has control"):
        told.control.take(two)
    assert told.control.controller == one
    assert told.texts[two] == [f"page {one} has control"]


def test_both_are_told_of_a_takeover(told):
    one, two, three = told.open(), told.open(), told.open()
    told.control.take(one)
    told.control.take(two, is_confirmed=True)
    with pytest.raises(RefusalError, match="take it first"):
        told.control.expect_control(one)
    assert told.texts[one] == [f"page {two} has taken over control: this page can only watch now"]
    assert told.texts[two][-1] == f"this page has taken over control from page {one}"
    assert told.texts[three][-1] == f"page {two} has control"


def test_a_page_that_is_lost_has_no_control_when_it_comes_back(told):
    page = told.open()
    told.control.take(page)
    told.control.close(page)
    assert told.control.controller is None
    again = told.open()
    assert again != page
    with pytest.raises(RefusalError, match="take it first"):
        told.control.expect_control(again)
    with pytest.raises(RefusalError, match="is closed"):
        told.control.take(page)


@pytest.mark.parametrize("what", ["soon", "late", "another tab", "taken", "released"])
def test_a_page_that_is_loaded_again_has_its_control_back_if_no_page_took_it(told, what):
    page, other = told.open("a"), told.open("b")
    told.control.take(page)
    if what == "released":
        told.control.release(page)
    told.control.close(page)
    if what == "taken":
        told.control.take(other)
        told.control.release(other)
    told.now = RECLAIM_TIME + (0.1 if what == "late" else -0.1)
    again = told.open("c" if what == "another tab" else "a")
    assert (told.control.controller == again) == (what == "soon")


def test_pages_that_open_and_close_are_noticed(told):
    seen = []
    told.control.on_change = lambda: seen.append(told.control.pages)
    one, two = told.open(), told.open()
    told.control.close(one)
    told.control.close(two)
    told.control.close(two)
    assert seen == [(one,), (one, two), (two,), ()]
