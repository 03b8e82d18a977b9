"""Programs that start while the ROS master is stopped: it accepts requests, and never answers."""

import socket
import subprocess
import sys
import threading
import xmlrpc.client
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from crazyflie_utils import main

LIMIT = 60.0  #: Time limit of a program (s).

PROGRAMS = {
    "node": "from crazyflie_utils.main import run; run('crazyflie_utils.node:Node', 'waiting')",
    "script": "from crazyflie_utils.main import begin_script; begin_script('waiting')",
}


def end(program, uri, monkeypatch):
    """Return status and messages of a program that starts with a master at an address."""
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    monkeypatch.setenv("ROS_IP", "127.0.0.1")
    code = [sys.executable, "-c", PROGRAMS[program]]
    ended = subprocess.run(code, capture_output=True, text=True, timeout=LIMIT)
    return ended.returncode, ended.stderr


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_master_that_is_stopped_ends_a_program(program, monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as stopped:
        uri = f"http://127.0.0.1:{stopped.getsockname()[1]}"
        status, text = end(program, uri, monkeypatch)
    assert status == 1
    assert f"the ROS master at {uri} has not answered within 3 s" in text


@pytest.mark.parametrize("answered", [{b"getPid": 1}, {b"getPid": 1, b"getSystemState": 1}])
def test_a_master_that_is_stopped_meanwhile_ends_a_node(answered, monkeypatch):
    """``answered``: requests that are answered, as often, before it is stopped."""
    left, may_end = dict(answered), threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            name = next((each for each in left if each in body and left[each] > 0), None)
            if name is None:
                may_end.wait(LIMIT)
                return
            left[name] -= 1
            value = [[], [], []] if name == b"getSystemState" else 1
            data = xmlrpc.client.dumps(((1, "", value),), methodresponse=True).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        uri = f"http://127.0.0.1:{server.server_port}"
        try:
            status, text = end("node", uri, monkeypatch)
        finally:
            may_end.set()
            server.shutdown()
    assert not any(left.values())
    assert status == 1
    assert f"the ROS master at {uri} has not answered within 3 s" in text


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("needs_master", [True, False])
def test_only_what_needs_the_master_is_watched_after_the_start(needs_master, monkeypatch):
    is_silent, ended = threading.Event(), threading.Event()

    def answers():
        if is_silent.is_set():
            sys.exit("silent")
        return True

    def exit_at_once(status):
        ended.set()
        raise SystemExit(status)

    monkeypatch.setattr(main, "_answers", answers)
    monkeypatch.setattr(main, "_WATCH_PERIOD", 0.01)
    monkeypatch.setattr(main, "exit_at_once", exit_at_once)
    before = set(threading.enumerate())
    with main._watched_master(lambda: needs_master):
        (watch,) = set(threading.enumerate()) - before
    is_silent.set()
    watch.join(LIMIT)
    assert not watch.is_alive()
    assert ended.is_set() == needs_master
