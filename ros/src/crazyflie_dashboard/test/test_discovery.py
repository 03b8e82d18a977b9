"""Vehicles are found by topics and services."""

from std_srvs.srv import Empty

from crazyflie_dashboard import discovery
from crazyflie_dashboard.discovery import Graph, vehicles
from crazyflie_dashboard.snapshot import Action
from crazyflie_driver import srv

STATE = "crazyflie_msgs/PositionVelocityYawStateStamped"
CONTROL = "crazyflie_msgs/ControlStamped"


def services(*names, node="/node"):
    return dict.fromkeys(names, node)


def names(graph):
    return [each.name for each in vehicles(graph)]


def test_the_software_example_is_a_vehicle_without_a_namespace():
    graph = Graph(
        topics={"/state": STATE, "/control/final": CONTROL, "/tf": "tf2_msgs/TFMessage"},
        services=services("/takeoff", "/land", "/emergency", "/emergency_reset"),
    )
    (vehicle,) = vehicles(graph)
    assert vehicle.name == "/"
    assert vehicle.topics["state"] == ("/state", STATE)
    assert vehicle.services[Action.TAKEOFF].kind is Empty
    # A node for moves is started when one is asked for.
    go_to = vehicle.services[Action.GO_TO]
    assert go_to.needs_commander
    assert go_to.name == "/high_level/go_to"
    assert Action.REBOOT not in vehicle.services


def test_a_fleet_is_in_natural_order_and_flown_by_its_high_level_services():
    graph = Graph(
        topics={f"/cf{k}/state": STATE for k in (10, 9, 1)},
        services={
            f"/{top}/{name}": "/fleet"
            for top in ("cf1", "cf1/high_level", "all", "all/high_level")
            for name in ("takeoff", "land", "go_to", "upload_trajectory")
        },
    )
    assert names(graph) == ["cf1", "cf9", "cf10"]
    found = vehicles(graph)[0].services
    assert found[Action.TAKEOFF].name == "/cf1/high_level/takeoff"
    assert found[Action.TAKEOFF].kind is srv.Takeoff
    assert found[Action.GO_TO].name == "/cf1/high_level/go_to"


def test_a_driver_alone_is_a_vehicle():
    graph = Graph(
        topics={"/cf7/battery": "std_msgs/Float32", "/cf7/pose": "geometry_msgs/PoseStamped"},
        services=services(
            *(f"/cf7/{n}" for n in ("takeoff", "land", "go_to", "upload_trajectory", "emergency")),
            *(f"/cf7/{n}" for n in ("reboot", "arm", "recover", "update_params")),
        ),
    )
    (vehicle,) = vehicles(graph)
    assert vehicle.has_driver
    assert vehicle.actions == {*Action} - {Action.RESET}
    assert vehicle.services[Action.GO_TO].name == "/cf7/go_to"


def test_in_the_hardware_example_the_driver_belongs_to_the_only_vehicle():
    graph = Graph(
        topics={
            "/state": STATE,
            "/control/final": CONTROL,
            "/crazyflie/cmd_vel": "geometry_msgs/Twist",
            "/crazyflie/battery": "std_msgs/Float32",
        },
        services=services("/takeoff", "/land", "/emergency", "/crazyflie/emergency"),
    )
    (vehicle,) = vehicles(graph)
    assert (vehicle.name, vehicle.driver) == ("/", "/crazyflie")
    assert vehicle.topics["battery"][0] == "/crazyflie/battery"
    # Both stop the motors, whichever of them works.
    assert vehicle.emergencies == ("/emergency", "/crazyflie/emergency")


def test_objects_of_the_world_are_vehicles_only_where_nothing_else_is():
    ball = {"/world/ball/pose": "geometry_msgs/PoseStamped"}
    assert names(Graph(topics={**ball, "/cf1/state": STATE})) == ["cf1"]
    assert names(Graph(topics=ball)) == ["world/ball"]


def test_topics_of_other_types_are_not_those_of_a_vehicle():
    assert names(Graph(topics={"/robot/state": "std_msgs/String"})) == []


def test_vehicles_by_remapped_topics_have_the_names_at_their_ends():
    graph = Graph(
        topics={
            **{f"/state{name}": STATE for name in ("HY4", "HY5")},
            "/in_flightHY4_flight_status": "crazyflie_msgs/FlightStatus",
            "/state_smooth": STATE,
        },
        services=services("/takeoffHY4", "/landHY4", "/emergencyHY4", "/takeoffHY5"),
    )
    found = {each.name: each for each in vehicles(graph)}
    assert found.keys() == {"HY4", "HY5"}
    assert found["HY4"].topics["flight_status"][0] == "/in_flightHY4_flight_status"
    assert found["HY4"].services[Action.TAKEOFF].name == "/takeoffHY4"
    assert found["HY4"].emergencies == ("/emergencyHY4",)
    assert found["HY5"].actions == {Action.TAKEOFF}


def test_services_are_looked_through_once_for_all_vehicles(monkeypatch):
    """A graph comes every 2 s: once for each of a hundred vehicles took an eighth of a core."""
    looked, read = [], discovery.namespace_of
    monkeypatch.setattr(discovery, "namespace_of", lambda *a: looked.append(a) or read(*a))
    fleet = [f"/cf{k}" for k in range(20)]
    vehicles(Graph({f"{each}/state": STATE for each in fleet}, {}, services(*fleet)))
    named = [name for name, pattern in looked if pattern == discovery._NAMED]
    assert sorted(named) == sorted(fleet)
