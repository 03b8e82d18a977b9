"""Log and faults of the node handle, on a fake process."""

import threading

from std_msgs.msg import String

LIMIT = 60.0


def test_log_names_the_node(process, handle):
    for level in ("info", "warn", "error"):
        getattr(handle, level)("text")
        assert process.logged(level) == ["/ns/node: text"]


def test_throttled_warnings(process, handle, monkeypatch):
    now = [50.0]
    monkeypatch.setattr("crazyflie_utils.context.time.monotonic", lambda: now[0])
    for _ in range(3):
        handle.warn("a", throttle=1.0)
        handle.warn("b", throttle=1.0)
        handle.warn("c 1", throttle=1.0, key="c")
        handle.warn("c 2", throttle=1.0, key="c")
    assert process.logged("warn") == [f"/ns/node: {text}" for text in ("a", "b", "c 1")]
    now[0] = 51.0
    handle.warn("a", throttle=1.0)
    handle.warn("always")
    handle.warn("always")
    assert [text[-6:] for text in process.logged("warn")[3:]] == ["ode: a", "always", "always"]


def failing(process):
    """Return a handle whose subscriber of /a fails, by the message's text."""
    handle = process.handle("/ns/node")

    def on_message(message):
        if message.data == "value":
            int("x")
        raise KeyError(message.data)

    handle.subscribe("/a", String, on_message)
    return handle


def test_fault_is_logged_once_with_its_traceback(process):
    failing(process)
    for _ in range(50):
        process.publish("/a", String("key"))
    (error,) = process.logged("error")
    assert "on_message failed" in error
    assert "Traceback" in error
    assert "raise KeyError(message.data)" in error
    (again,) = process.logged("warn")
    assert "on_message failed again: KeyError('key') (2 times)" in again


def test_another_fault_is_logged_too(process):
    failing(process)
    process.publish("/a", String("key"))
    process.publish("/a", String("value"))
    assert ["ValueError" in error for error in process.logged("error")] == [False, True]


def test_node_is_told_of_every_fault(process):
    made_safe = []
    failing(process).on_fault(lambda: made_safe.append(1))
    for _ in range(3):
        process.publish("/a", String("key"))
    assert made_safe == [1, 1, 1]


def test_make_safe_that_fails_is_logged(process):
    failing(process).on_fault(lambda: {}["nothing"])
    process.publish("/a", String("value"))
    assert "enter_safe_state failed too: KeyError('nothing')" in process.logged("error")[1]


def test_faults_of_one_node_leave_others_alone(process):
    failing(process)
    received, ticks = [], []
    process.handle("/other").subscribe("/a", String, received.append)
    process.publish("/a", String("key"))
    assert len(received) == 1
    process.handle("/other").timer(0.1, lambda: ticks.append(1))
    process.advance(0.2)
    assert len(ticks) == 2


def test_timer_survives_an_exception(process, handle):
    ticks = []

    def tick():
        ticks.append(1)
        raise RuntimeError("every time")

    handle.timer(0.1, tick)
    process.advance(1.0)
    assert len(ticks) == 10
    assert len(process.logged("error")) == 1


def test_callbacks_of_many_threads_never_meet(process, handle):
    inside, met = threading.Lock(), []

    def on_message(message):
        met.append(not inside.acquire(blocking=False))
        met.append(False)
        inside.release()

    for topic in ("/a", "/b"):
        handle.subscribe(topic, String, on_message)

    def publish(topic):
        for _ in range(200):
            process.publish(topic, String())

    threads = [
        threading.Thread(target=publish, args=(topic,), daemon=True) for topic in ("/a", "/b") * 3
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT)
    assert len(met) == 2 * 6 * 200
    assert not any(met)
