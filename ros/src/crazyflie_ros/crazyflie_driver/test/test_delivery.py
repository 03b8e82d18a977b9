"""Work that waits for the callbacks' turn, and dropped data."""

import queue
import threading

from crazyflie_driver.vehicle_base import MAX_WAITING, Delivery

LIMIT = 60.0


class Handle:
    """The node's, whose callbacks have their turn when a test lets them."""

    def __init__(self):
        self.busy = threading.Event()
        self.free = threading.Event()

    def input(self, callback):
        def pass_on(argument):
            self.busy.set()
            self.free.wait(LIMIT)
            callback(argument)

        return pass_on

    def start(self, begin):
        begin()


def test_order_is_kept_and_only_data_are_dropped():
    handle = Handle()
    delivery = Delivery(handle, "test")
    called = queue.Queue()
    submit, submit_data = delivery.outlet(called.put), delivery.outlet(called.put, are_data=True)
    submit("first")
    assert handle.busy.wait(LIMIT)
    for k in range(MAX_WAITING + 10):
        submit_data(k)
    submit("last")
    handle.free.set()
    expected = ["first", *range(MAX_WAITING), "last"]
    assert [called.get(timeout=LIMIT) for _ in expected] == expected
    delivery.close()


def test_nothing_is_called_after_the_end():
    handle = Handle()
    delivery = Delivery(handle, "test")
    called = queue.Queue()
    submit = delivery.outlet(called.put)
    submit("at work")
    assert handle.busy.wait(LIMIT)
    submit("waiting")
    delivery.close()
    thread = next(each for each in threading.enumerate() if each.name == "test-delivery")
    handle.free.set()
    thread.join(LIMIT)
    assert called.empty()
