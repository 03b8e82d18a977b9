"""Two virtual vehicles that motion capture sees fly along waypoints, and land."""

import math

from flights import Stick, launched, virtual_vehicle, wait_for_service
from rostest_hover import Positions, config, virtual_mocap

from crazyflie_demo.joystick import LAND, TAKEOFF
from crazyflie_demo.waypoint_node import Demo1Node, Demo2Node
from crazyflie_utils.testing.programs import free_port

VISITED = 3
"""Waypoints of each tour that are waited for."""


def test_two_tours(tmp_path):
    command_port, observer_port = free_port(), free_port()
    starts = [node.waypoints[0] for node in (Demo1Node, Demo2Node)]

    def vehicle(number):
        parameters = {"observer/port": observer_port, "init/x": starts[number - 1].x}
        return virtual_vehicle(number, **parameters)

    with (
        Stick(tmp_path / "js0") as stick,
        virtual_mocap(command_port, observer_port),
        vehicle(1) as uri1,
        vehicle(2) as uri2,
        launched(
            "crazyflie_demo",
            "multi_waypoint_mocap.launch",
            uri1=uri1,
            uri2=uri2,
            joy_dev=tmp_path / "js0",
            mocap="true",
            frame1="Robot_1/base_link",
            frame2="Robot_2/base_link",
            mocap_config_file=config(tmp_path / "mocap.yaml", command_port, 2),
        ),
    ):
        tracked = Positions("Robot_1/base_link", "Robot_2/base_link")
        for prefix in ("crazyflie1", "crazyflie2"):
            wait_for_service(f"/{prefix}/controller/takeoff")
            wait_for_service(f"/{prefix}/emergency")
        tracked.positions()
        stick.press(TAKEOFF)
        remaining = [list(node.waypoints[:VISITED]) for node in (Demo1Node, Demo2Node)]

        def have_been_everywhere(*positions):
            assert math.dist(*positions) > 0.6
            for waypoints, position in zip(remaining, positions, strict=True):
                if waypoints and math.dist(position, waypoints[0][:3]) < 0.3:
                    waypoints.pop(0)
            return not any(remaining)

        tracked.wait_until(have_been_everywhere)
        stick.press(LAND)
        tracked.wait_until(lambda *vehicles: all(position[2] < 0.01 for position in vehicles))
