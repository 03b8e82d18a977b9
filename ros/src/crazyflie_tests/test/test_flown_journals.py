"""Flights of the examples are run again from their journals, to the bit."""

import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from crazyflie_reports.replay import Status, replay
from crazyflie_reports.replay_program import journals_of, replay_all
from crazyflie_utils.journal.journal_file import Journal, Kind
from crazyflie_utils.journal.replay_transport import Rows
from crazyflie_utils.testing.programs import free_port

_SCRIPT = Path(__file__).parent / "journal_flight.py"
_SW_HOVER = ("crazyflie_examples", "sw_hover.launch", "rviz:=false")
_SIMULATED = ("sim_time:=true", "simulator_dt:=0.01", "real_time_factor:=0")
_SWARM = ("crazyflie_examples", "sw_swarm.launch", "rviz:=false", "sim_time:=true")
_KILLED = ("/takeoff_control_filter", "/lqr_controller", "/state_estimator", "/takeoff_server")


def swarm(n):
    """Return the arguments for a swarm, which flies as fast as it goes."""
    vehicles = [f"--vehicle=/cf{k + 1}" for k in range(n)]
    return (*vehicles, *_SWARM, "real_time_factor:=0", f"n:={n}")


#: Of virtual hardware, whose vehicle and motion capture read sockets.
_VIRTUAL = ("/virtual_crazyflie", "/virtual_mocap")
_HARDWARE = ("/crazyflie_server", "/mocap_node", "/state_estimator", "/lqr_controller")
_PORTS = ("port", "observer_port", "command_port", "data_port")

#: Name of a flight -> how it is flown, and how many journals each node has.
_FLIGHTS = {
    # The link is lost, and another one is set up.
    "hardware": (
        (
            *(f"--freeze={_VIRTUAL[0]}", "crazyflie_examples", "virtual_hw_hover.launch"),
            *("rviz:=false", *(f"{name}:=free" for name in _PORTS)),
        ),
        dict.fromkeys((*_VIRTUAL, *_HARDWARE), 1),
    ),
    "killed": (
        (*(f"--kill={node}" for node in _KILLED), *_SW_HOVER),
        {"/simulator": 1, **dict.fromkeys(_KILLED, 2)},
    ),
    "composed": ((*_SW_HOVER, *_SIMULATED, "composed:=true"), {"/composed": 1}),
    "swarm": (swarm(3), {"/fleet": 1}),
    "large swarm": (swarm(20), {"/fleet": 1}),
}


@pytest.fixture(
    scope="module",
    params=[
        "hardware",
        "killed",
        "composed",
        "swarm",
        # The small one takes less time.
        pytest.param("large swarm", marks=pytest.mark.long),
    ],
)
def flight(request, tmp_path_factory):
    """Fly once; return the journals, and how many each node must have."""
    arguments, expected = _FLIGHTS[request.param]
    folder = tmp_path_factory.mktemp("journals")
    words = [each for each in arguments if each.startswith("--")]
    launch = [
        each.replace("free", str(free_port())) for each in arguments if not each.startswith("--")
    ]
    command = [sys.executable, _SCRIPT, *words, folder, *launch]
    flown = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert flown.returncode == 0, flown.stderr[-5000:]
    return journals_of([folder]), expected


def test_each_process_has_a_journal(flight):
    paths, expected = flight
    found = Counter(Journal(path).header["node"] for path in paths)
    assert {node: found[node] for node in expected} == expected


def test_replays_are_identical(flight):
    paths, _ = flight
    digests = []
    for _ in range(3):
        outcomes = list(replay_all(paths))
        texts = "\n".join(each.text for each in outcomes)
        statuses = dict(zip(paths, (each.status for each in outcomes), strict=True))
        for path, status in statuses.items():
            is_virtual = Journal(path).header["node"] in _VIRTUAL
            assert status is (Status.NOT_REPEATABLE if is_virtual else Status.IDENTICAL), texts
        digests.append([each.digest for each in outcomes])
    assert digests[1:] == digests[:-1]


def test_those_that_were_killed_are_told_from_the_others(flight):
    paths, expected = flight
    killed = [
        Journal(path).header["node"]
        for path in paths
        if "did not end by itself" in replay(path).text
    ]
    assert sorted(killed) == sorted(node for node, count in expected.items() if count > 1)


@pytest.mark.parametrize("flight", ["hardware"], indirect=True)
def test_the_driver_has_lost_a_link_and_set_up_another_one(flight):
    """What it sends the vehicle is compared, too."""
    paths, _ = flight
    (path,) = (each for each in paths if Journal(each).header["node"] == "/crazyflie_server")
    rows, values = Rows(Journal(path)), Counter()
    while rows.next is not None:
        row = rows.take()
        if row.kind is Kind.VALUE:
            values[row.data.partition(b"(")[0].partition(b" ")[2].decode()] += 1
        elif row.kind is Kind.SUBMITTED:
            values["lost"] += b'"lost"' in row.data
            values["again"] += b" again" in row.data
    assert values["lost"] > 0
    assert values["again"] == 1
    assert values["setpoints.attitude"] > 100


@pytest.mark.long  # test_replays_are_identical has three.
@pytest.mark.parametrize("flight", ["composed"], indirect=True)
def test_a_hundred_replays_give_the_same_bytes(flight):
    paths, _ = flight
    outcomes = list(replay_all(paths * 100))
    assert {each.status for each in outcomes} == {Status.IDENTICAL}
    assert len({each.digest for each in outcomes}) == len(paths)
