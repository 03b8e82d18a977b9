"""Topics of firmware variables do not have the names of a vehicle's other topics."""

import pytest
from simulated_fleet import Swarm

from crazyflie_driver.driver_parameters import _OWN_TOPICS
from crazyflie_fleet import fleet_file
from crazyflie_fleet.fleet_config import RESERVED_NAMES
from crazyflie_fleet.virtual_fleet_process import make_nodes
from crazyflie_utils import ParameterError
from crazyflie_utils.testing import FakeProcess

TOPIC = """\
robots:
  cf1:
    uri: radio://0/80/2M/E7E7E7E701
    initial_position: [0, 0, 0]
    {}firmware_logging:
      custom_topics:
        {}: {{frequency: 10, vars: [pm.vbat]}}
"""
TYPE = "type: cf\nrobot_types:\n  cf:\n    "


def names_below(process, *vehicles):
    """Return the first names below vehicles of all topics and services."""
    transport = process.transport
    names = (*transport.subscribers, *transport.publishers, *transport.services)
    parts = [name.split("/") for name in names]
    return {part[2] for part in parts if part[1] in vehicles and len(part) > 2}


@pytest.mark.parametrize("name", sorted(RESERVED_NAMES))
def test_a_topic_of_the_vehicle_is_refused_with_its_line(name):
    with pytest.raises(ParameterError) as caught:
        fleet_file.parse(TOPIC.format("", name), "fleet.yaml")
    assert str(caught.value) == (
        f"fleet.yaml:7: robots/cf1/firmware_logging/custom_topics/{name} is a name of the "
        "vehicle's own topics; expected another name"
    )


def test_so_it_is_in_a_type():
    with pytest.raises(ParameterError, match="robot_types/cf/.*/state is a name of the vehicle's"):
        fleet_file.parse(TOPIC.format(TYPE, "state"))


def test_another_name_is_not_refused():
    (vehicle,) = fleet_file.parse(TOPIC.format("", "states")).vehicles
    assert list(vehicle.log_topics) == ["states"]


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("simulated", [True, False])
def test_all_names_of_a_fleet_are_reserved(tmp_path, simulated, together):
    file = tmp_path / "fleet.yaml"
    # The second one takes off only when both have been measured apart.
    file.write_text(
        "robots: {cf1: {initial_position: [0, 0, 0]}, cf2: {initial_position: [0, 0.1, 0]}}"
    )
    swarm = Swarm(simulated=simulated, together=together, fleet={"file": str(file)})
    names = names_below(swarm.process, "cf1", "cf2")
    assert {"state", "ref", "takeoff_inhibition", "takeoff"} <= names
    # Parts of nodes have private names, in namespaces of their own.
    assert names - RESERVED_NAMES <= {"takeoff_server", "takeoff_control_filter"} | {
        name.split("/")[2] for name in swarm.nodes if name.count("/") == 2
    }


def test_all_topics_of_the_driver_and_of_virtual_vehicles_are_reserved():
    assert RESERVED_NAMES.issuperset(_OWN_TOPICS)
    process = FakeProcess()
    process.transport.set_param("/virtual_fleet/fleet", {"n": 1, "virtual_port": 19850})
    nodes = make_nodes(process.handle("/virtual_fleet"))
    topics = process.transport.parameters["/virtual_fleet/cf1/topics/true_pose"]
    assert nodes
    assert topics.removeprefix("/cf1/") in RESERVED_NAMES


@pytest.mark.parametrize("downwash", [False, True])
def test_virtual_vehicles_share_their_air_if_they_are_to_feel_it(downwash):
    process = FakeProcess()
    parameters = {"fleet": {"n": 2, "virtual_port": 19850}, "downwash": downwash}
    process.transport.set_param("/virtual_fleet", parameters)
    nodes = make_nodes(process.handle("/virtual_fleet"))
    first, second = (nodes[f"/virtual_fleet/{name}"].air for name in ("cf1", "cf2"))
    assert first is second
    assert (first is not None) is downwash
