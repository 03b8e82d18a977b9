"""Reaction of a process to a ROS master that has ended, restarted, or does not know it."""

import http.client
from types import SimpleNamespace

import pytest
import rosgraph
from rospy.impl import registration

from crazyflie_utils.ros1 import master_watch
from crazyflie_utils.ros1.master_watch import MasterWatch


class Master:
    """A ROS master as a node sees it."""

    def __init__(self):
        self.pid = 1000
        self.known = True
        self.is_there = True
        self.absence = ConnectionRefusedError()
        self.on_look = lambda: None

    def lookupNode(self, name):  # noqa: N802
        """Return the address of a node."""
        self.on_look()
        self._answer()
        if not self.known:
            raise rosgraph.MasterError("unknown node")
        return "http://127.0.0.1:1/"

    def getPid(self):  # noqa: N802
        """Return the process of the master."""
        self._answer()
        return self.pid

    def _answer(self):
        if not self.is_there:
            raise self.absence


class World:
    """A master, a watch, and what it did."""

    def __init__(self, monkeypatch):
        self.master = Master()
        self.said = []
        self.registered = 0
        self.is_ending = False
        monkeypatch.setattr("rosgraph.Master", lambda name: self.master)
        monkeypatch.setattr("rospy.logwarn", self.said.append)
        monkeypatch.setattr("rospy.core.is_shutdown_requested", lambda: self.is_ending)
        monkeypatch.setattr(master_watch, "register", self._register)
        self.watch = MasterWatch()

    def _register(self):
        self.registered += 1
        self.master.known = True


@pytest.fixture
def world(monkeypatch):
    """Return a process that the master knows."""
    world = World(monkeypatch)
    world.watch.look()
    assert (world.said, world.registered) == ([], 0)
    return world


def test_a_master_that_is_restarted_is_told_of_this_process(world):
    world.master.is_there = False
    for _ in range(3):
        world.watch.look()
    assert world.said == ["the ROS master does not answer; existing connections continue"]
    world.master.is_there, world.master.known, world.master.pid = True, False, 2000
    for _ in range(3):
        world.watch.look()
    assert world.said[1:] == ["the ROS master was restarted; registering with it"]
    assert world.registered == 1


def test_so_is_one_that_was_away_too_shortly_to_be_missed(world):
    world.master.known, world.master.pid = False, 2000
    world.watch.look()
    assert world.said == ["the ROS master was restarted; registering with it"]
    assert world.registered == 1


def test_a_process_that_ends_is_not_registered_again(world):
    """It takes its registrations back while its last callbacks run."""

    def end():
        world.is_ending, world.master.known = True, False

    world.master.on_look = end
    world.watch.look()
    assert (world.said, world.registered) == ([], 0)


def test_a_master_that_only_forgot_this_process_is_not_said_to_be_new(world):
    """As after rosnode cleanup while the process was frozen."""
    world.master.known = False
    world.watch.look()
    assert world.said == ["the ROS master does not know this node any more; registering again"]
    assert world.registered == 1


def test_the_same_master_that_is_back_is_no_news(world):
    world.master.is_there = False
    world.watch.look()
    world.master.is_there = True
    world.watch.look()
    assert len(world.said) == 1
    assert world.registered == 0


def test_a_program_that_has_the_port_of_the_master_meanwhile_does_not_end_the_watch(world):
    world.master.is_there, world.master.absence = False, http.client.BadStatusLine("hello")
    world.watch.look()
    assert world.said == ["the ROS master does not answer; existing connections continue"]


@pytest.fixture
def registered(monkeypatch):
    """Return the registrations, and updates for rospy, of a process with topics and services."""
    own, other = "http://own", "http://other"
    subscriptions = {
        "/handed_over": SimpleNamespace(has_connection=lambda uri: uri == own),
        "/from_outside": SimpleNamespace(has_connection=lambda uri: False),
        "/silent": SimpleNamespace(has_connection=lambda uri: False),
    }
    uris = {"/handed_over": [own], "/from_outside": [own, other], "/silent": []}
    topics = SimpleNamespace(
        subs=subscriptions,
        get_publications=lambda: [("/handed_over", "a/B")],
        get_subscriptions=lambda: [(name, "a/B") for name in subscriptions],
    )
    offered = ("/cf1/takeoff", "/cf1/upload_trajectory", "/cf1/high_level/go_to", "/cf1/land")
    services = SimpleNamespace(get_services=lambda: [(name, own) for name in offered])
    calls, updates = [], []

    def multicall(requests):
        calls.extend((each["methodName"], each["params"][1]) for each in requests)
        return [[[1, "", uris.get(each["params"][1], 0)]] for each in requests]

    master = SimpleNamespace(system=SimpleNamespace(multicall=multicall))
    listener = SimpleNamespace(publisher_update=lambda *update: updates.append(update))
    monkeypatch.setattr("rospy.core.xmlrpcapi", lambda uri: master)
    monkeypatch.setattr("rospy.get_node_uri", lambda: own)
    monkeypatch.setattr(registration, "get_topic_manager", lambda: topics)
    monkeypatch.setattr(registration, "get_service_manager", lambda: services)
    listeners = SimpleNamespace(listeners=[listener])
    monkeypatch.setattr(registration, "get_registration_listeners", lambda: listeners)
    master_watch.register()
    return calls, updates


def test_rospy_is_told_only_of_publishers_that_are_not_connected_yet(registered):
    """It checks each topic of the process for each update: 100 vehicles took a core for minutes."""
    _, updates = registered
    assert updates == [("/from_outside", ["http://own", "http://other"])]


def test_who_sees_the_takeoff_of_a_vehicle_sees_how_it_is_flown(registered):
    """A mission looked in between, and called the takeoff server as if it were a driver."""
    services = [name for method, name in registered[0] if method == "registerService"]
    assert len(services) == 4
    assert services.index("/cf1/high_level/go_to") < services.index("/cf1/takeoff")
    assert services.index("/cf1/takeoff") < services.index("/cf1/upload_trajectory")
