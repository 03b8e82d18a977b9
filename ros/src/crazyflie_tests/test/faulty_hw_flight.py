"""Fly the hardware example on virtual hardware with faults of vehicle, link and mocap.

Prints what was seen as JSON. Usage: faulty_hw_flight.py [ARGUMENT:=VALUE ...]
"""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rosgraph
import rospy
from dynamic_reconfigure.client import Client
from faulty_flight import LIMIT, node_process
from hardware_observer import LOG_PARAMETER, HardwareFlight
from std_msgs.msg import Empty, Float32, String
from std_srvs.srv import Empty as EmptyService

from crazyflie_driver.srv import RemoveCrazyflie
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils.testing.peer import wait_until
from crazyflie_utils.testing.programs import free_port, running

# A battery is nearly empty within a second, and a takeoff ends after a short hover.
_PARAMETERS = {
    "/takeoff_server/duration/hover": 0.5,
    "/takeoff_server/battery/low": 3.45,
    "/takeoff_server/battery/critical": 3.2,
    "/takeoff_server/battery/duration": 1.0,
}


def next_message(topic, message_type):
    """Return what the next message on a topic, or a latched one, says."""
    return rospy.wait_for_message(topic, message_type, LIMIT).data


def call(service):
    """Call a service of type Empty."""
    rospy.wait_for_service(service, LIMIT)
    rospy.ServiceProxy(service, EmptyService)()


def end_the_emergency():
    """Reset the filter's stop, as soon as that is not refused."""

    def is_accepted():
        try:
            call("/emergency_reset")
        except rospy.ServiceException as error:
            assert "less than 2 s ago" in str(error)
            return False
        return True

    wait_until(is_accepted, "the end of the emergency", LIMIT)


def lose_the_link(flight, duration):
    """Silence the link."""
    begin = flight.observer.now
    flight.vehicle.words.clear()
    Client("/virtual_crazyflie", LIMIT).update_configuration({"fault/silence": duration})
    flight.observer.hover(duration + 1.0)
    wait_until(flight.vehicle.is_logging, "the link", LIMIT)
    end = flight.is_back_at(1.0)
    return {
        "heights": flight.observer.range_since(begin),
        "height afterwards": end,
        "locked": flight.vehicle.is_locked,
        "words": flight.vehicle.words[:],
    }


def lose_motion_capture_for_a_moment(flight):
    """Silence motion capture for 0.3 s."""
    begin = flight.observer.now
    motion_capture = Client("/virtual_mocap", LIMIT)
    motion_capture.update_configuration({"fault/silent": True})
    # The duration of the silence is under test; it is not a wait.
    time.sleep(0.3)
    motion_capture.update_configuration({"fault/silent": False})
    flight.observer.hover(2.0)
    return {
        "heights": flight.observer.range_since(begin),
        "height afterwards": flight.is_back_at(1.0),
    }


def lose_motion_capture(flight):
    """Silence motion capture until the vehicle is down."""
    begin = rospy.get_time()
    motion_capture = Client("/virtual_mocap", LIMIT)
    motion_capture.update_configuration({"fault/silent": True})
    flight.wait_for_ground()
    seconds = rospy.get_time() - begin
    refusal = flight.refusal()
    motion_capture.update_configuration({"fault/silent": False})
    seen = {
        "seconds to the ground": seconds,
        "fastest descent": flight.vehicle.fastest_descent_since(begin),
        "refusal": refusal,
    }
    wait_until(flight.vehicle.motors_stand_still, "the motors to stop", LIMIT)
    down = rospy.get_time()
    flight.vehicle.wait_for_log_of(down + 1.5)
    return {**seen, "highest PWM afterwards": flight.vehicle.highest_pwm_since(down)}


def stop_in_emergency(flight):
    """Call /emergency in flight, and end it again."""
    called = rospy.get_time()
    call("/emergency")
    flight.wait_for_ground()
    refusal = flight.refusal()
    flight.vehicle.wait_for_log_of(called + 2.1)
    end_the_emergency()
    return {"refusal": refusal, "seconds": flight.vehicle.motors_stop_after(called)}


def restart_the_firmware(flight):
    """Restart the vehicle while the controller streams."""
    flight.vehicle.restart()
    begin = rospy.get_time()
    # Earlier data may be from before the restart.
    flight.vehicle.wait_for_log_of(begin + 0.3)
    came_back = rospy.get_time() - begin
    flight.wait_for_ground()
    flight.vehicle.wait_for_log_of(rospy.get_time() + 2.0)
    highest = flight.vehicle.highest_pwm_since(begin + 0.3)
    flight.observer.land()
    return {"topics came back after": came_back, "highest PWM": highest}


def empty_the_battery(flight):
    """Make the battery nearly empty."""
    begin = rospy.get_time()
    Client("/virtual_crazyflie", LIMIT).update_configuration({"fault/low_battery": True})
    flight.wait_for_ground()
    descent = flight.vehicle.fastest_descent_since(begin)
    refusal = ""
    # The landing goes on for a moment, and refuses takeoffs of its own accord.
    while "battery" not in refusal and rospy.get_time() - begin < LIMIT:
        refusal = flight.refusal()
    return {"fastest descent": descent, "refusal": refusal}


@contextlib.contextmanager
def another_battery(flight):
    """Switch the vehicle off, and on again with another battery for the time of a with block."""
    os.kill(node_process("/virtual_crazyflie"), signal.SIGKILL)
    rospy.set_param("/virtual_crazyflie/fault/low_battery", False)
    wait_until(lambda: not flight.vehicle.is_logging(), "the vehicle to be off", LIMIT)
    vehicle = ["rosrun", "crazyflie_virtual", "virtual_crazyflie", "__name:=virtual_crazyflie"]
    with running(*vehicle, stdout=subprocess.DEVNULL):
        wait_until(lambda: next_message("/crazyflie/battery", Float32) > 4.0, "4 V", LIMIT)
        yield


def stop_all_in_emergency(flight):
    """Stop all vehicles in flight."""
    publisher = rospy.Publisher("/all/emergency", Empty, queue_size=1)
    wait_until(lambda: publisher.get_num_connections() >= 2, "driver and filter", LIMIT)
    begin = rospy.get_time()
    publisher.publish()
    flight.wait_for_ground()
    flight.vehicle.wait_for_log_of(begin + 2.1)
    # The filter's stop can be reset, the driver's not.
    end_the_emergency()
    status = next_message("/crazyflie/status", String)
    return {"status": status, "seconds": flight.vehicle.motors_stop_after(begin)}


def add_the_vehicle_again(flight):
    """Do what the driver wants done after an emergency stop."""
    rospy.ServiceProxy("/remove_crazyflie", RemoveCrazyflie)(flight.vehicle.uri)
    flight.vehicle.restart()
    # Its parameters are those that the launch file has set.
    name = next(name for name in rospy.get_param("/crazyflie") if "crazyflie_add" in name)
    add = ["crazyflie_add", "__ns:=/crazyflie", f"__name:={name}"]
    with running("rosrun", "crazyflie_driver", *add, stdout=subprocess.DEVNULL) as adding:
        adding.wait(LIMIT)
    flight.wait_for_vehicle()


def kill_the_driver(flight):
    """Kill the driver in flight."""
    begin = flight.observer.now
    os.kill(node_process("/crazyflie_server"), signal.SIGKILL)
    wait_until(lambda: flight.observer.height < 0.03, "the ground", LIMIT)
    flight.observer.hover(0.5)
    with Crazyflie(flight.vehicle.uri) as another:
        state = another.supervisor.read()
    return {
        "heights": flight.observer.range_since(begin),
        "seconds to the ground": flight.observer.now - begin - 0.5,
        "locked": SupervisorState.LOCKED in state,
    }


def remove_the_vehicle(flight):
    """Try to remove the vehicle in flight; return the answer and the heights afterwards."""
    begin = flight.observer.now
    answer = "ok"
    try:
        rospy.ServiceProxy("/remove_crazyflie", RemoveCrazyflie)(flight.vehicle.uri)
    except rospy.ServiceException as error:
        answer = str(error)
    flight.observer.hover(1.0)
    return {"answer": answer, "heights": flight.observer.range_since(begin)}


def kill_filter_and_converter(flight):
    """Kill both in flight: nothing is sent to the vehicle until they are started again."""
    flight.observer.hover(2.0)
    begin = flight.observer.now
    for node in ("/takeoff_control_filter", "/cmd_vel_converter"):
        os.kill(node_process(node), signal.SIGKILL)
    flight.observer.hover(4.0)
    return {
        "heights": flight.observer.range_since(begin),
        "locked": flight.vehicle.is_locked,
        "height afterwards": flight.is_back_at(1.0),
    }


def end_node(flight, name):
    """End a node in flight, as with rosnode kill."""
    begin = flight.observer.now
    with running("rosnode", "kill", name, stdout=subprocess.DEVNULL):
        wait_until(lambda: flight.observer.height < 0.03, "the ground", LIMIT)
    return {
        "fastest descent": flight.observer.fastest_descent_since(begin),
        "status": next_message("/in_flight_status", String),
    }


def press_ctrl_c(flight, roslaunch):
    """Press Ctrl-C in flight."""
    begin = flight.observer.now
    roslaunch.send_signal(signal.SIGINT)
    status = roslaunch.wait(LIMIT)
    return {
        "status of roslaunch": status,
        "height": flight.observer.height,
        "fastest descent": flight.observer.fastest_descent_since(begin),
        "seconds": rospy.get_time() - begin,
    }


def fly(core_command, arguments, folder):
    """Fly, and return what was seen: name -> figures."""
    seen = {}
    log = folder / "launch.log"
    variables = folder / "log.yaml"
    variables.write_text(LOG_PARAMETER)
    ports = {name: free_port() for name in ("port", "observer_port", "command_port", "data_port")}
    launch = ["roslaunch", "--wait", "crazyflie_examples", "virtual_hw_hover.launch", "rviz:=false"]
    launch += [f"{name}:={port}" for name, port in ports.items()]
    launch += ["genericLogTopics:=[truth]", "genericLogTopicFrequencies:=[20]"]
    launch += [f"genericLogTopicVariables_file:={variables}", *arguments]
    with (
        log.open("w") as output,
        running(*core_command, stdout=output, stderr=output),
    ):
        wait_until(rosgraph.is_master_online, "a master", LIMIT)
        # roslaunch waits for what roscore says of itself.
        for name, value in {"/run_id": "faulty_hw_flight", **_PARAMETERS}.items():
            rosgraph.Master("/flight").setParam(name, value)

        with running(*launch, stdout=output, stderr=output) as roslaunch:
            flight = HardwareFlight(ports["port"])
            flight.wait_for_vehicle()
            seen["first takeoff"] = flight.take_off()
            seen["link lost for 0.4 s"] = lose_the_link(flight, 0.4)
            seen["link lost for 1 s"] = lose_the_link(flight, 1.0)
            seen["motion capture lost for 0.3 s"] = lose_motion_capture_for_a_moment(flight)
            seen["motion capture lost"] = lose_motion_capture(flight)
            seen["second takeoff"] = flight.take_off()
            seen["emergency"] = stop_in_emergency(flight)
            flight.lift_off()
            seen["firmware restarted"] = restart_the_firmware(flight)
            flight.lift_off()
            seen["Ctrl-C"] = press_ctrl_c(flight, roslaunch)
        with running(*launch, stdout=output, stderr=output):
            flight.wait_for_vehicle()
            flight.lift_off()
            seen["battery low"] = empty_the_battery(flight)
            with another_battery(flight):
                wait_until(
                    lambda: "refused" not in next_message("/in_flight_status", String),
                    "the server to know",
                    LIMIT,
                )
                flight.lift_off()
                seen["emergency of all"] = stop_all_in_emergency(flight)
                add_the_vehicle_again(flight)
                flight.lift_off()
                seen["driver killed"] = kill_the_driver(flight)
        for node in ("crazyflie_server", "mocap_node"):
            with running(*launch, stdout=output, stderr=output):
                flight.wait_for_vehicle()
                flight.lift_off()
                if node == "crazyflie_server":
                    seen["filter killed"] = kill_filter_and_converter(flight)
                seen["removed"] = remove_the_vehicle(flight)
                seen[f"{node} asked to end"] = end_node(flight, f"/{node}")
    return seen


def main(arguments):
    """Fly and print."""
    port = free_port(socket.SOCK_STREAM)
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    os.environ["ROS_IP"] = "127.0.0.1"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            seen = fly(["rosmaster", "--core", "-p", port], arguments, folder)
        except BaseException:
            print((folder / "launch.log").read_text(), file=sys.stderr)
            raise
    print(json.dumps(seen, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
