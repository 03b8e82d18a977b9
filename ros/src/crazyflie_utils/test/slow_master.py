"""A master that lets nodes wait while they register, for the rostests."""

import contextlib
import threading
import urllib.request
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import rosgraph

from crazyflie_utils.testing.peer import LIMIT


@contextlib.contextmanager
def slow_master():
    """Pass requests on to the real master; those that register a process wait.

    Yields
    ------
    str
        Its URI.
    threading.Event
        Set when a node registers.
    threading.Event
        To be set, so that it is answered.
    """
    asked, may_go_on = threading.Event(), threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            if b"system.multicall" in body and b"registerPublisher" in body:
                asked.set()
                may_go_on.wait(LIMIT)
            request = urllib.request.Request(
                rosgraph.get_master_uri(), body, {"Content-Type": "text/xml"}
            )
            with urllib.request.urlopen(request, timeout=LIMIT) as answer:
                data = answer.read()
            self.send_response(200)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/", asked, may_go_on
        finally:
            may_go_on.set()
            server.shutdown()
