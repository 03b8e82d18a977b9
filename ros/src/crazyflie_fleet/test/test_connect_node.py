"""The node that has the driver connect a fleet."""

from concurrent.futures import Future
from pathlib import Path

import rospkg

from crazyflie_driver.srv import (
    AddCrazyflieResponse,
    UpdateParamsResponse,
    WriteLighthouseResponse,
)
from crazyflie_fleet.connect_node import FLEET_LIMIT, FLEET_SERVICES, FleetConnectNode
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess

EXAMPLE = Path(rospkg.RosPack().get_path("crazyflie_fleet")) / "config" / "example.yaml"


def offer_fleet(process, *names):
    """Offer the services of vehicles of a running fleet."""
    for name in names:
        process.transport.services |= {f"/{name}/{each}": None for each in FLEET_SERVICES}


class Driver:
    """A driver that knows some addresses; the fleet is running."""

    def __init__(self, process, missing=()):
        offer_fleet(process, "cf1", "cf2")
        self.missing = missing
        self.added = {}
        self.updated = {}
        services = process.transport.services
        services["/add_crazyflie"] = self.add
        for name in ("cf1", "cf2"):
            services[f"/{name}/update_params"] = lambda r, name=name: self.update(name, r)

    def add(self, request):
        self.added[request.tf_prefix] = request
        answer = Future()
        if request.tf_prefix in self.missing:
            answer.set_exception(ServiceError("does not answer"))
        else:
            answer.set_result(AddCrazyflieResponse())
        return answer

    def update(self, name, request):
        self.updated[name] = request.params
        answer = Future()
        answer.set_result(UpdateParamsResponse())
        return answer


def add(missing=(), **parameters):
    process = FakeProcess()
    driver = Driver(process, missing)
    launched = process.launch(
        FleetConnectNode(), "/fleet_add", {"fleet/file": str(EXAMPLE), **parameters}
    )
    return process, driver, launched


def test_vehicles_are_added_and_their_parameters_written():
    process, driver, _ = add()
    assert process.exit_status == 0
    assert list(driver.added) == ["cf1", "cf2"]
    second = driver.added["cf2"]
    assert second.uri == "radio://0/80/2M/E7E7E7E702"
    assert (second.enable_logging_pose, second.enable_logging_imu) == (True, False)
    (block,) = second.log_blocks
    # The driver's frequency is a period in ms.
    assert (block.topic_name, block.frequency, len(block.variables)) == ("motors", 100, 4)
    expected = ["stabilizer/estimator", "stabilizer/controller", "locSrv/extPosStdDev"]
    assert driver.updated == {"cf1": expected, "cf2": expected}
    assert process.transport.parameters["/cf1/locSrv/extPosStdDev"] == 0.001


def test_the_fleet_has_its_names_before_the_driver():
    # Of two nodes with a service of one name, callers reach the one that has registered it last.
    process = FakeProcess()
    driver = Driver(process)
    del process.transport.services["/cf2/go_to"]
    assert process.launch(FleetConnectNode(), "/fleet_add", {"fleet/file": str(EXAMPLE)})
    process.advance(5.0)
    assert driver.added == {}
    offer_fleet(process, "cf2")
    process.advance(0.5)
    assert list(driver.added) == ["cf1", "cf2"]
    assert process.logged("warn") == []


def test_vehicles_are_added_without_a_fleet_after_a_while():
    process = FakeProcess()
    driver = Driver(process)
    del process.transport.services["/cf2/go_to"]
    assert process.launch(FleetConnectNode(), "/fleet_add", {"fleet/file": str(EXAMPLE)})
    process.advance(FLEET_LIMIT + 0.5)
    assert list(driver.added) == ["cf1", "cf2"]
    assert process.logged("warn") == [
        "/fleet_add: the fleet does not offer /cf2/go_to after 20 s; if it starts later, its "
        "services and the driver's take each other's names"
    ]


def test_a_slow_master_blocks_no_callback(monkeypatch):
    process = FakeProcess()
    driver = Driver(process)
    writes = []

    def set_later(name, value):
        writes.append((name, value, Future()))
        return writes[-1][2]

    monkeypatch.setattr(process.transport, "set_param_later", set_later)
    assert process.launch(FleetConnectNode(), "/fleet_add", {"fleet/file": str(EXAMPLE)})
    assert [name for name, _, _ in writes if "extPosStdDev" in name] == [
        "/cf1/locSrv/extPosStdDev",
        "/cf2/locSrv/extPosStdDev",
    ]
    assert driver.updated == {}
    for name, value, done in writes:
        if name.startswith("/cf1"):
            process.transport.parameters[name] = value
            done.set_result(None)
        else:
            done.set_exception(OSError("no master"))
    process.advance(0.1)
    assert list(driver.updated) == ["cf1"]
    assert "cf2, radio://0/80/2M/E7E7E7E702: no master" in process.logged("error")[0]
    assert process.exit_status == 1


def test_a_master_that_does_not_answer_is_waited_for_with_a_limit(monkeypatch):
    process = FakeProcess()
    driver = Driver(process)
    writes = []

    def set_later(name, value):
        writes.append(Future())
        return writes[-1]

    monkeypatch.setattr(process.transport, "set_param_later", set_later)
    assert process.launch(FleetConnectNode(), "/fleet_add", {"fleet/file": str(EXAMPLE)})
    process.advance(59.0)
    assert process.exit_status is None
    process.advance(2.0)
    assert process.exit_status == 1
    assert driver.updated == {}
    assert "has not been written within 60 s" in process.logged("error")[0]
    errors = process.logged("error")
    # An answer that comes after the limit changes nothing.
    for written in writes:
        written.set_result(None)
    process.advance(1.0)
    assert driver.updated == {}
    assert process.logged("error") == errors


def test_who_is_not_there_is_named_and_the_others_are_added():
    process, driver, _ = add(missing=("cf1",))
    assert process.exit_status == 1
    assert list(driver.updated) == ["cf2"]
    assert process.logged("error")[-1] == (
        "/fleet_add: vehicles are not connected: cf1; to try again: rosrun crazyflie_fleet "
        "fleet_add_node __name:=fleet_add _vehicles:='[cf1]'"
    )


def test_vehicles_that_were_missing_are_added_without_the_others():
    process, driver, _ = add(vehicles=["cf2"])
    assert process.exit_status == 0
    assert list(driver.added) == list(driver.updated) == ["cf2"]


def test_a_vehicle_that_is_not_in_the_file_is_named():
    process, _, launched = add(vehicles=["cf9"])
    assert not launched
    assert "parameter vehicles has cf9; expected names among cf1, cf2" in process.logged("error")[0]


def test_virtual_vehicles_have_ports_for_addresses():
    _, driver, _ = add(**{"fleet/virtual_port": 30000})
    assert driver.added["cf2"].uri == "udp://127.0.0.1:30001"


def test_an_address_is_needed(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text("robots: {a: {initial_position: [0, 0, 0]}}\n")
    process, driver, launched = add(**{"fleet/file": str(file)})
    assert not launched
    assert "a has no uri; expected one" in process.logged("error")[0]
    assert driver.added == {}


def lighthouse_fleet(folder, file):
    text = EXAMPLE.read_text(encoding="utf-8")
    text = text.replace("\nall:\n", f"\nall:\n  lighthouse: {file}\n")
    path = folder / "fleet.yaml"
    path.write_text(text, encoding="utf-8")
    return {"fleet/file": str(path)}


def test_base_stations_are_written_before_the_parameters(tmp_path):
    (tmp_path / "room.yaml").write_text("")
    process = FakeProcess()
    driver = Driver(process)
    written = {}

    def write(name, request):
        assert name not in driver.updated
        written[name] = request.file
        answer = Future()
        answer.set_result(WriteLighthouseResponse())
        return answer

    for name in ("cf1", "cf2"):
        service = f"/{name}/write_lighthouse"
        process.transport.services[service] = lambda r, name=name: write(name, r)
    parameters = lighthouse_fleet(tmp_path, "room.yaml")
    assert process.launch(FleetConnectNode(), "/fleet_add", parameters)
    assert process.exit_status == 0
    assert written == {name: str(tmp_path / "room.yaml") for name in ("cf1", "cf2")}
    assert set(driver.updated) == {"cf1", "cf2"}


def test_a_lighthouse_file_that_is_not_there(tmp_path):
    process = FakeProcess()
    assert not process.launch(
        FleetConnectNode(), "/fleet_add", lighthouse_fleet(tmp_path, "no.yaml")
    )
    (error,) = process.logged("error") or process.logged("fatal")
    assert "lighthouse of cf1 is 'no.yaml', and there is no file" in error
