#!/usr/bin/env python
"""Flies the mission with cf1 ... cf4 of sw_swarm.launch n:=4."""

from crazyflie_mission_api import Fleet
from four_vehicles.mission import LIMITS, ROOM, mission

with Fleet(["cf1", "cf2", "cf3", "cf4"], bounds=ROOM, limits=LIMITS) as fleet:
    fleet.fly(mission)
