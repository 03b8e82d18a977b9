"""Flights of the software example whose measured position is not that above the ground below."""

from random import Random

import pytest
from std_srvs.srv import EmptyRequest

from crazyflie_dev.soak import Soak
from crazyflie_dev.soak_faults import with_each
from crazyflie_msgs.msg import PositionVelocityStateStamped


class Flight:
    """A soak whose poses are measured with an offset, m, fixed frame, or show another place."""

    def __init__(self, dynamics, z=0.0):
        self.run = Soak(seed=3, simulator_dt=0.01, dynamics=dynamics)
        self.graph = self.run.graph
        self.z = z
        self.place = None
        self._random = Random(1)
        self.run.watch.may_fly = True
        self.run.watch.allow(3.0)
        self._fault = with_each(self._change)(self.run._flight)
        next(self._fault)

    def _change(self, transform, _):
        translation = transform.transform.translation
        translation.z += self.z
        if self.place is not None:
            noise = self._random.gauss
            translation.x, translation.y, translation.z = (
                each + noise(0.0, 0.001) for each in self.place
            )

    def take_off(self):
        takeoff = self.graph.call("/takeoff", EmptyRequest())
        self.graph.advance(10.0)
        assert takeoff.done() and takeoff.exception() is None

    def refer(self, z):
        message = PositionVelocityStateStamped()
        message.header.stamp = self.graph.stamp()
        message.state.z = z
        self.graph.publish("/ref", message)
        self.graph.advance(5.0)


@pytest.mark.parametrize("table", [0.3, 0.75])
@pytest.mark.parametrize("dynamics", ["near_hover", "quadrotor"])
def test_a_vehicle_that_took_off_from_a_table_lands_on_the_floor(dynamics, table):
    """The simulated ground is at z = 0, so the table is an offset that vanishes in flight."""
    flight = Flight(dynamics, z=table)
    flight.graph.advance(2.0)
    flight.take_off()
    flight.refer(table + 0.5)
    watch = flight.run.watch
    assert watch.height == pytest.approx(0.5, abs=0.05)
    while flight.z > 0.0:
        flight.z = max(flight.z - 0.002, 0.0)
        flight.graph.advance(0.02)
    flight.graph.advance(3.0)
    assert watch.height == pytest.approx(table + 0.5, abs=0.05)
    land = flight.graph.call("/land", EmptyRequest())
    flight.graph.advance(12.0)
    assert land.done() and land.exception() is None
    assert watch.height == 0.0
    assert 0.1 < watch.hardest < 0.6
    assert watch.violations == []


@pytest.mark.parametrize("dynamics", ["near_hover", "quadrotor"])
@pytest.mark.parametrize("jump", [0.5, 1.0, 3.0])
def test_a_vehicle_does_not_follow_a_pose_that_has_jumped(dynamics, jump):
    """Such as that of a reflection, which stays where it is."""
    flight = Flight(dynamics)
    flight.take_off()
    flight.place = (jump, 0.0, 1.0)
    flight.graph.advance(15.0)
    watch = flight.run.watch
    flight.place = None
    flight.graph.advance(1.0)
    assert watch.state == "on_ground"
    assert watch.height == 0.0
    assert watch.farthest < 0.3
