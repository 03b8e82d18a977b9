"""Timers by simulated time, with any publisher of /clock."""

import pytest
import rospy
from processes import composed, small_node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64

from crazyflie_utils.testing.peer import LIMIT, listening, wait_until

PERIOD = 0.5


def test_clock_from_outside_drives_timers():
    clock = rospy.Publisher("/clock", Clock, queue_size=100)
    with (
        listening("/ticker/time", Float64) as ticks,
        small_node("Ticker", "ticker", f"_time_step:={PERIOD}"),
    ):

        def set_clock(moment):
            clock.publish(Clock(rospy.Time.from_sec(moment)))

        def first_tick(begin):
            # Time moves until a node notices; after a step back, too.
            moments = iter(begin + count * PERIOD for count in range(10**6))

            def step():
                set_clock(next(moments))
                return not ticks.empty()

            wait_until(step, "a tick")
            return ticks.get().data

        def tick_in_step(begin):
            set_clock(begin)
            while ticks.get(timeout=LIMIT).data != begin:
                pass
            for count in range(1, 21):
                set_clock(begin + count * PERIOD / 2)
                if count % 2 == 0:
                    assert ticks.get(timeout=LIMIT).data == begin + count * PERIOD / 2
            assert ticks.empty()

        assert first_tick(1e5) >= 1e5
        tick_in_step(2e5)
        assert first_tick(10.0) < 1e5
        tick_in_step(1e5)
    clock.unregister()


def test_clock_of_a_node_in_the_process_drives_timers():
    for name in ("fast", "slow"):
        rospy.set_param(f"/{name}/time_step", {"fast": 0.1, "slow": PERIOD}[name])
    with (
        listening("/fast/time", Float64) as fast,
        listening("/slow/time", Float64) as slow,
        listening("/clock", Clock) as clock,
        composed("simulation", clockwork="Clockwork", fast="Ticker", slow="Ticker"),
    ):
        for heard, period in ((fast, 0.1), (slow, PERIOD)):
            moments = [heard.get(timeout=LIMIT).data for _ in range(20)]
            # The first are lost to those who connect later, and no other.
            first = round(moments[0] / period)
            assert moments == pytest.approx([(first + count) * period for count in range(20)])
        assert clock.get(timeout=LIMIT).clock.to_sec() > 0.0
        wait_until(lambda: rospy.get_time() > 1.0, "rospy's own clock to move")
