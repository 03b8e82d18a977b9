"""The battery and the geofence, and what people are told."""

import pytest
from dynamic_reconfigure.msg import Config, DoubleParameter
from flight_words import until_on_ground, word
from std_msgs.msg import Bool, Float32, String
from std_srvs.srv import EmptyRequest
from takeoff_helpers import SERVER, filter_status, state

from crazyflie_msgs.msg import FlightStatus
from crazyflie_takeoff.refusals import BatteryCheck, Charge
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.testing import FakeProcess

# The battery.


def with_battery(z, said):
    process = FakeProcess()
    parameters = {**SERVER, "topics/battery": "/battery"}
    assert process.launch(TakeoffServerNode(), "/takeoff_server", parameters)
    process.publish("/in_flight_filter_status", filter_status(said))
    discharge(process, 4.0, 1.0, z)
    return process


def discharge(process, voltage, duration, z=0.0):
    for k in range(round(duration * 10)):
        if k % 10 == 0:
            process.publish("/battery", Float32(voltage))
        process.publish("/state", state(z))
        process.advance(0.1)


def test_a_low_battery_keeps_on_the_ground():
    process = with_battery(0.0, "on_ground")
    discharge(process, 3.1, 4.0)
    assert process.published("/in_flight_status")[-1].data == "on ground"
    discharge(process, 3.1, 3.0)
    with pytest.raises(ServiceError, match="/takeoff refused: the battery is low, 3.10 V"):
        process.call("/takeoff", EmptyRequest())
    assert "the battery is low" in process.logged("warn")[0]
    discharge(process, 4.1, 1.0)
    assert not process.call("/takeoff", EmptyRequest()).done()


def test_a_critical_battery_lands():
    process = with_battery(1.0, "flying")
    for voltage, duration in ((2.9, 4.0), (3.3, 1.0), (3.1, 10.0), (2.9, 4.0)):
        discharge(process, voltage, duration, 1.0)
        assert word(process) == "flying"
    discharge(process, 2.9, 3.0, 1.0)
    assert word(process) == "descending"
    status = process.published("/in_flight_status")[-1].data
    assert status == "descending: the battery is low, 2.90 V"


def with_positioning(z, said):
    process = FakeProcess()
    parameters = {**SERVER, "topics/connected": "/cf1/connected"}
    assert process.launch(TakeoffServerNode(), "/takeoff_server", parameters)
    process.publish("/in_flight_filter_status", filter_status(said))
    stay(process, 1.0, z)
    return process


def stay(process, duration, z):
    for _ in range(round(duration * 10)):
        process.publish("/cf1/connected", Bool(True))
        process.publish("/state", state(z))
        process.advance(0.1)


def test_without_positioning_there_is_no_takeoff():
    process = with_positioning(0.0, "on_ground")
    process.publish("/cf1/positioning", String("no base station"))
    with pytest.raises(ServiceError, match="/takeoff refused: no base station"):
        process.call("/takeoff", EmptyRequest())
    process.publish("/cf1/positioning", String(""))
    assert not process.call("/takeoff", EmptyRequest()).done()


def test_the_loss_of_positioning_lands_once_it_lasts():
    process = with_positioning(1.0, "flying")
    process.publish("/cf1/positioning", String("no base station"))
    stay(process, 0.2, 1.0)
    assert word(process) == "flying"
    process.publish("/cf1/positioning", String(""))
    stay(process, 1.0, 1.0)
    assert word(process) == "flying"
    for k in range(5):
        process.publish("/cf1/positioning", String(f"deviation {k}"))
        stay(process, 0.1, 1.0)
    assert process.published("/in_flight_status")[-1].data.startswith("descending: deviation")


def test_a_battery_that_is_silent_or_not_a_number_says_nothing():
    process = with_battery(1.0, "flying")
    discharge(process, 2.9, 3.0, 1.0)
    for _ in range(10):
        process.publish("/battery", Float32(float("nan")))
        process.publish("/state", state(1.0))
        process.advance(1.0)
    process.publish("/battery", Float32(2.9))
    process.advance(0.1)
    assert word(process) == "flying"


def test_with_duration_zero_one_low_voltage_is_enough_and_a_good_one_is_good():
    battery = BatteryCheck(low=3.2, critical=3.0, duration=0.0)
    assert battery.charge(0.0) is Charge.UNKNOWN
    for time, (voltage, charge) in enumerate(
        [(4.0, Charge.GOOD), (3.1, Charge.LOW), (2.9, Charge.CRITICAL), (3.9, Charge.GOOD)]
    ):
        battery.measure(float(time), voltage)
        assert battery.charge(float(time)) is charge


def test_the_time_below_a_level_begins_with_the_first_voltage_that_is_below():
    battery = BatteryCheck(low=3.2, critical=3.0, duration=1.0)
    # Sags between good voltages, and one to critical from low, do not last.
    for time, (voltage, charge) in enumerate(
        [
            *[(3.9, Charge.GOOD), (2.9, Charge.GOOD)] * 3,
            (3.1, Charge.LOW),
            (2.9, Charge.LOW),
            (2.9, Charge.CRITICAL),
        ]
    ):
        battery.measure(float(time), voltage)
        assert battery.charge(float(time)) is charge


# Texts for the operator.


def test_status_in_words():
    process = FakeProcess()
    assert process.launch(TakeoffServerNode(), "/takeoff_server", SERVER)
    process.advance(0.2)
    process.publish("/in_flight_filter_status", filter_status("on_ground"))
    process.advance(2.0)
    process.publish("/state", state(0.0))
    process.advance(0.3)
    said = [message.data for message in process.published("/in_flight_status")]
    assert said[0] == "looking for the state of the flight"
    assert said[1].startswith("on ground: takeoff refused: no state has come on /state")
    assert said[2] == "on ground"


def test_status_in_a_message(network):
    network.advance(0.2)
    network.kill("controller")
    network.advance(1.0)
    status = network.on("/in_flight_flight_status")[-1][1]
    assert status.state == FlightStatus.FLYING
    assert status.reason == "no control comes, the filter keeps the vehicle in place"
    assert status.takeoff_refusal == "the vehicle is in flight; land first"
    until_on_ground(network)
    states = [message.state for _, message in network.on("/in_flight_flight_status")]
    assert list(dict.fromkeys(states)) == [
        FlightStatus.ON_GROUND,
        FlightStatus.TAKING_OFF,
        FlightStatus.FLYING,
        FlightStatus.LANDING,
    ]
    status = network.on("/in_flight_flight_status")[-1][1]
    assert status.takeoff_refusal == "no commanded controls come; is the controller running?"
    assert "no control came" in status.reason
    assert status.ground == pytest.approx(0.0, abs=1e-6)


def test_diagnostics(network):
    network.kill("controller")
    network.advance(4.0)
    for name in ("server", "filter"):
        status = network.last_of(name, "/diagnostics").status[0]
        assert status.name == name
        assert status.level == 2
        assert "no control came for 3.1 s" in status.message
    until_on_ground(network)
    network.advance(1.0)
    levels = [
        network.last_of(name, "/diagnostics").status[0].level for name in ("server", "filter")
    ]
    assert levels == [1, 0]


# The geofence.


def test_a_hover_point_outside_the_geofence_is_refused():
    process = FakeProcess()
    fence = {"box/max/z": 0.9, "box/min/x": -1.0}
    assert not process.launch(TakeoffServerNode(), "/takeoff_server", {**SERVER, **fence})
    assert "0.10 m outside the geofence" in process.logged("error")[0]


def test_the_box_of_a_running_geofence_counts_in_the_place_of_parameters():
    process = FakeProcess()
    fence = {"box/max/z": 0.9, "topics/box": "/geofence/parameter_updates"}
    assert process.launch(TakeoffServerNode(), "/takeoff_server", {**SERVER, **fence})
    process.publish("/in_flight_filter_status", filter_status("on_ground"))
    process.publish("/state", state(0.0))
    process.advance(0.02)
    low = Config(doubles=[DoubleParameter("box/max/z", 0.8)])
    process.publish("/geofence/parameter_updates", low)
    with pytest.raises(ServiceError, match="0.20 m outside the geofence"):
        process.call("/takeoff", EmptyRequest())
    with pytest.raises(ServiceError, match="0.10 m outside the geofence"):
        process.reconfigure("/takeoff_server", **{"hover/z": 0.9})
    process.publish("/geofence/parameter_updates", Config())
    assert not process.call("/takeoff", EmptyRequest()).done()
