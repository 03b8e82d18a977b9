"""Services of the node handle, on a fake process."""

from concurrent.futures import Future

import pytest
from std_msgs.msg import String
from std_srvs.srv import (
    Empty,
    EmptyRequest,
    EmptyResponse,
    SetBool,
    SetBoolRequest,
    SetBoolResponse,
    Trigger,
    TriggerResponse,
)

from crazyflie_utils.refusal import RefusalError, ServiceError

LIMIT = 60.0


def test_service_answers(process, handle):
    handle.advertise_service(
        "~switch", SetBool, lambda request: SetBoolResponse(request.data, "done")
    )
    answer = process.call("/ns/node/switch", SetBoolRequest(True))
    assert (answer.success, answer.message) == (True, "done")


def test_a_response_without_data_need_not_be_returned(process, handle):
    late = Future()
    handle.advertise_service("reset", Empty, lambda request: None)
    handle.advertise_service("reset_later", Empty, lambda request: late)
    assert process.call("/ns/reset", EmptyRequest()) == EmptyResponse()
    answer = process.call("/ns/reset_later", EmptyRequest())
    late.set_result(None)
    assert answer.result(LIMIT) == EmptyResponse()
    # One with data is never made up.
    handle.advertise_service("go", Trigger, lambda request: None)
    assert process.call("/ns/go", None) is None


@pytest.mark.parametrize("error", [ServiceError, RefusalError])
def test_service_refuses_with_its_text(process, handle, error):
    def refuse(request):
        raise error("already in flight")

    handle.advertise_service("go", Trigger, refuse)
    with pytest.raises(ServiceError, match="^already in flight$"):
        process.call("/ns/go", None)
    late = Future()
    late.set_exception(error("already in flight"))
    handle.advertise_service("go_late", Trigger, lambda request: late)
    with pytest.raises(ServiceError, match="^already in flight$"):
        process.call("/ns/go_late", None)
    assert process.logged("error") == []


def test_service_that_fails_is_reported_and_made_safe(process, handle):
    made_safe = []
    handle.on_fault(lambda: made_safe.append(1))
    handle.advertise_service("go", Trigger, lambda request: 1 / 0)
    with pytest.raises(ServiceError, match=r"/ns/node: ZeroDivisionError"):
        process.call("/ns/go", None)
    assert "ZeroDivisionError" in process.logged("error")[0]
    assert made_safe == [1]


def slow_service(handle):
    """Advertise /ns/go, which answers when the returned future does."""
    work = Future()
    handle.advertise_service("go", Trigger, lambda request: work)
    return work


def test_service_that_takes_time_lets_the_node_live_on(process, handle):
    work, ticks = slow_service(handle), []
    handle.timer(0.1, lambda: ticks.append(1))
    answer = process.call("/ns/go", None)
    assert isinstance(answer, Future)
    process.advance(1.0)
    assert len(ticks) == 10
    assert not answer.done()
    work.set_result(TriggerResponse(True, "late"))
    assert answer.result(LIMIT).message == "late"


def test_service_that_takes_time_may_refuse(process, handle):
    work = slow_service(handle)
    answer = process.call("/ns/go", None)
    work.set_exception(ServiceError("lost"))
    with pytest.raises(ServiceError, match="^lost$"):
        answer.result(LIMIT)


@pytest.mark.parametrize("error", [TimeoutError("late"), ZeroDivisionError("x")])
def test_service_that_takes_time_and_fails_is_logged(process, handle, error):
    work = slow_service(handle)
    answer = process.call("/ns/go", None)
    work.set_exception(error)
    with pytest.raises(ServiceError, match=type(error).__name__):
        answer.result(LIMIT)
    assert type(error).__name__ in process.logged("error")[0]


def test_service_that_is_cancelled_says_so(process, handle):
    work = slow_service(handle)
    answer = process.call("/ns/go", None)
    work.cancel()
    with pytest.raises(ServiceError, match="cancelled"):
        answer.result(LIMIT)


def test_nodes_call_services_without_waiting(process, handle):
    handle.advertise_service(
        "go", SetBool, lambda request: SetBoolResponse(request.data, str(order.append("served")))
    )
    order = []

    def call(message):
        future = process.handle("/caller").call_service("/ns/go", SetBool, SetBoolRequest(True), 1)
        future.add_done_callback(lambda done: order.append(done.result().success))
        order.append("called")

    process.handle("/caller").subscribe("/a", String, call)
    process.publish("/a", String())
    assert order == ["called", "served", True]


def test_what_is_added_to_a_call_fails_like_any_callback(process, handle):
    handle.advertise_service("go", Trigger, lambda request: TriggerResponse())
    safe = []
    handle.on_fault(lambda: safe.append(True))

    def fail(done):
        raise ValueError(f"success is {done.result().success}")

    for service in ("go", "gone"):
        handle.call_service(service, Trigger, None, 1.0).add_done_callback(fail)
    assert safe == [True, True]
    errors = process.logged("error")
    assert ["fail failed\nTraceback" in text for text in errors] == [True, True]
    assert "ValueError: success is False" in errors[0]
    assert "ServiceError: there is no service /ns/gone" in errors[1]


def test_called_service_that_refuses_or_is_missing(process, handle):
    def refuse(request):
        raise ServiceError("no")

    handle.advertise_service("go", Trigger, refuse)
    assert str(handle.call_service("go", Trigger, None, 1.0).exception(LIMIT)) == "no"
    assert "/ns/gone" in str(handle.call_service("gone", Trigger, None, 1.0).exception(LIMIT))
