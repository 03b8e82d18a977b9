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

    def submit(self, callback, *arguments):
        self.busy.set()
        self.free.wait(LIMIT)
        callback(*arguments)


def test_order_is_kept_and_only_data_are_dropped():
    handle = Handle()
    delivery = Delivery(handle, "test")
    called = queue.Queue()
    delivery.submit(called.put, "first")
    assert handle.busy.wait(LIMIT)
    for k in range(MAX_WAITING + 10):
        delivery.submit_data(called.put, k)
    delivery.submit(called.put, "last")
    handle.free.set()
    expected = ["first", *range(MAX_WAITING), "last"]
    assert [called.get(timeout=LIMIT) for _ in expected] == expected
    delivery.close()


def test_nothing_is_called_after_the_end():
    handle = Handle()
    delivery = Delivery(handle, "test")
    called = queue.Queue()
    delivery.submit(called.put, "at work")
    assert handle.busy.wait(LIMIT)
    delivery.submit(called.put, "waiting")
    delivery.close()
    thread = next(each for each in threading.enumerate() if each.name == "test-delivery")
    handle.free.set()
    thread.join(LIMIT)
    assert [called.get(timeout=LIMIT), called.empty()] == ["at work", True]
