"""What becomes of commands, by what vehicles do."""

from concurrent.futures import Future

import pytest
from fake_dashboard import vehicle

from crazyflie_dashboard.page_data import Command
from crazyflie_dashboard.progress import Commands, Stage
from crazyflie_dashboard.snapshot import Action
from crazyflie_utils.refusal import RefusalError

PLACES = {"cf1": (0.0, 0.0, 1.0), "cf2": (1.0, 0.0, 1.0)}


class Pages:
    """Commands of two vehicles, at a time that is set."""

    def __init__(self):
        self.now = 10.0
        self.commands = Commands(lambda: self.now)

    def begin(self, action, page=1, names=("cf1", "cf2"), **details):
        command = Command(action, tuple(names), self.now, **details)
        return self.commands.begin(page, command.title, command.vehicles, PLACES, command)

    def answer(self, number, **refusals):
        done = Future()
        done.set_result({"cf1": "", "cf2": "", **refusals})
        self.commands.answered(number, done)

    def see(self, **details):
        known = {"is_in_flight": True, "state": "flying", **details}
        known.setdefault("z", 1.0)
        x = known.pop("x", 0.0)
        self.commands.update({n: vehicle(n, k + x, **known) for k, n in enumerate(PLACES)})
        return self.commands.rows[-1]


@pytest.fixture
def pages():
    return Pages()


def test_a_move_is_sent_accepted_under_way_and_done(pages):
    number = pages.begin(Action.GO_TO, goal=(2.5, 0.0, 1.0))
    assert pages.see().stage is Stage.SENT
    pages.answer(number)
    row = pages.see(x=0.8)
    assert (row.stage, row.detail) == (Stage.UNDER_WAY, "2/2 accepted, 1.2 m and 2 s left")
    assert row.left["cf1"] == "go to: 1.2 m left"
    pages.now += 4.0
    row = pages.see(x=1.95)
    assert (row.stage, row.detail, row.left) == (Stage.DONE, "after 4 s", {})


def test_a_takeoff_counts_the_vehicles_that_have_begun(pages):
    pages.begin(Action.TAKEOFF)
    row = pages.see(is_in_flight=True, state="taking off", z=0.4)
    assert row.detail == "2/2 accepted, 0.6 m and 1 s left"


def test_a_refusal_is_the_end_with_its_reasons(pages):
    number = pages.begin(Action.TAKEOFF)
    pages.answer(number, cf2="battery at 3.05 V")
    row = pages.see(is_in_flight=False, state="on the ground", z=0.0)
    assert (row.stage, row.detail) == (Stage.REFUSED, "1/2 accepted")
    assert row.reasons == ("cf2: battery at 3.05 V",)


def test_a_command_is_ended_by_another_one_an_emergency_or_a_landing(pages):
    pages.answer(pages.begin(Action.GO_TO, goal=(2.5, 0.0, 1.0)))
    refused = pages.begin(Action.LAND, page=2)
    done = Future()
    done.set_exception(RefusalError("this page can only watch"))
    pages.commands.answered(refused, done)
    assert pages.commands.rows[0].stage is Stage.UNDER_WAY
    pages.answer(pages.begin(Action.HOLD, page=2, names=["cf1"]), cf2="")
    first = pages.commands.rows[0]
    assert (first.stage, first.detail) == (Stage.ENDED, "by: hold cf1 (page 2)")
    pages.answer(pages.begin(Action.GO_TO, goal=(2.5, 0.0, 1.0)))
    pages.see()
    row = pages.see(is_in_flight=False, is_emergency=True, state="emergency")
    assert (row.stage, row.detail) == (Stage.ENDED, "by an emergency of cf1")
    pages.answer(pages.begin(Action.GO_TO, goal=(2.5, 0.0, 1.0)))
    pages.see()
    row = pages.see(state="landing", reason="the battery is empty")
    assert (row.stage, row.detail) == (Stage.ENDED, "cf1 is landing: the battery is empty")


def test_a_move_that_does_not_arrive_is_given_up(pages):
    pages.answer(pages.begin(Action.GO_TO, goal=(2.5, 0.0, 1.0)))
    pages.now += 40.0
    row = pages.see()
    assert (row.stage, row.detail) == (Stage.ENDED, "2.0 m are left after 30 s more")


def test_the_end_of_a_mission_is_told(pages):
    number = pages.commands.begin(1, "fly square.py with cf1", ("cf1",), PLACES)
    pages.commands.follow(number)
    assert pages.see().stage is Stage.UNDER_WAY
    done = Future()
    done.set_exception(RefusalError("cf1: no pose"))
    pages.now += 5.0
    pages.commands.ended(number, done)
    row = pages.see()
    assert (row.stage, row.detail, row.reasons) == (Stage.ENDED, "after 5 s", ("cf1: no pose",))
