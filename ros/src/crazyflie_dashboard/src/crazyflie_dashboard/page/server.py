"""Serves the page from a thread of its own."""

import asyncio
import logging
import socket
import threading
from functools import partial
from pathlib import Path

import uvicorn
from fastapi import FastAPI
from nicegui import Client, app, core, ui
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response

from crazyflie_dashboard.access import Access
from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.page.gate import Gate
from crazyflie_dashboard.page.view import View

FOLDER = Path(__file__).parent
#: Styles, the clock of clicks, the emergency key, and a sentence for browsers that are too old.
HEAD = (FOLDER / "head.html").read_text() + (
    f"<style>{(FOLDER / 'dashboard.css').read_text()}</style>"
)

#: Longest time without an answer of a browser (s). After it the connection is lost, and the page is
#: loaded again, without its control and choices. A browser that draws in software on a busy
#: computer exceeds NiceGUI's 2 s.
ANSWER_TIMEOUT = 10.0
CLOSING_TIME = 3.0  #: Longest time for the end of the server (s).


async def _emergency(dashboard: Dashboard, request: Request) -> Response:
    """Stop motors; answer with the failures, a list of texts."""
    try:
        asked = await request.json()
        age, vehicles = float(asked["age"]), asked["vehicles"]
        names = None if vehicles is None else tuple(map(str, vehicles))
    except (KeyError, TypeError, ValueError):
        return JSONResponse(['the request is not {"age": s, "vehicles": list or null}'], 422)
    outcomes = await asyncio.wrap_future(dashboard.emergency(names, age))
    return JSONResponse([f"{name}: {text}" for name, text in outcomes.items() if text])


async def _camera(dashboard: Dashboard, request: Request) -> Response:
    """Answer with the newest picture of a page's camera."""
    number = request.query_params.get("page", "")
    image = dashboard.image(int(number)) if number.isdigit() else None
    if not isinstance(image, bytes):
        return Response(status_code=204)
    kind = "image/png" if image.startswith(b"\x89PNG") else "image/jpeg"
    return Response(image, media_type=kind, headers={"cache-control": "no-store"})


async def _report(dashboard: Dashboard, request: Request) -> Response:
    """Answer with the report on the last recording, or on one or two that are named."""
    names = tuple(request.query_params.getlist("of"))
    report = dashboard.report(names)
    if report is None:
        return PlainTextResponse("There is no such report.\n", 404)
    return FileResponse(report, media_type="text/html")


class Page:
    """The server of the page until `close`; one in a process, as NiceGUI's application.

    `OSError`: the address cannot be listened on.
    """

    def __init__(self, dashboard: Dashboard, access: Access):
        family = socket.AF_INET6 if ":" in access.host else socket.AF_INET
        self._listener = socket.create_server((access.host, access.port), family=family)
        application = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        Client.shared_head_html = HEAD
        application.post("/emergency")(partial(_emergency, dashboard))
        application.get("/camera")(partial(_camera, dashboard))
        application.get("/report")(partial(_report, dashboard))

        # Without a history of messages, a page that has lost its connection is reloaded.
        ui.page("/", title="Crazyflie mission control")(lambda: View(dashboard))
        ui.run_with(
            application,
            dark=None,  # As the system is.
            tailwind=False,
            binding_refresh_interval=None,
            message_history_length=0,
            show_welcome_message=False,
        )
        # NiceGUI sets its own when it starts.
        app.on_startup(lambda: setattr(core.sio.eio, "ping_timeout", ANSWER_TIMEOUT))
        logging.getLogger("nicegui").setLevel(logging.WARNING)
        config = uvicorn.Config(
            Gate(application, access),
            log_level="warning",
            access_log=False,
            ws="wsproto",
            ws_per_message_deflate=False,
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [self._listener]}, daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stop serving; open pages say that the connection is lost."""
        self._server.should_exit = True
        self._thread.join(CLOSING_TIME)
        self._listener.close()
