"""A page without a browser: takes what the dashboard sends, and draws nothing."""

import asyncio
import os
import re
import threading
import urllib.request
import uuid
from urllib.parse import urlencode

import socketio

from crazyflie_dev.bench.graph import NotMeasuredError

_LIMIT = 30.0  #: Longest wait for an answer of the dashboard (s).
_NICENESS = 19  #: Niceness of the thread: a browser on another computer would not load this one.


class PageClient:
    """A page at an address such as http://127.0.0.1:8642, open for the time of a with block.

    It connects as NiceGUI's script in a browser does, and reads in a thread of its own.
    """

    def __init__(self, url: str):
        self.scenes = 0  #: Messages with the poses of all vehicles that have come.
        self._url = url
        self._is_open, self._is_over = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._read()), daemon=True)

    def __enter__(self) -> "PageClient":
        self._thread.start()
        if not self._is_open.wait(_LIMIT):
            raise NotMeasuredError(f"{self._url} is no page of NiceGUI 3, or does not answer")
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join(_LIMIT)

    async def _read(self) -> None:
        # In Linux the niceness is a thread's.
        os.nice(_NICENESS)
        with urllib.request.urlopen(self._url, timeout=_LIMIT) as answer:
            (client_id,) = re.findall(r"'client_id': '([^']+)'", answer.read().decode())
        query = {
            "client_id": client_id,
            "document_id": uuid.uuid4(),
            "tab_id": uuid.uuid4(),
            "next_message_id": 0,
            "implicit_handshake": "true",
        }
        client = socketio.AsyncClient(reconnection=False)
        client.on("vehicles", self._on_vehicles)
        await client.connect(
            f"{self._url}/?{urlencode(query)}",
            headers={"Origin": self._url},
            transports=["websocket"],
            socketio_path="/_nicegui_ws/socket.io",
            wait_timeout=_LIMIT,
        )
        self._is_open.set()
        while not self._is_over.is_set():
            await asyncio.sleep(0.1)
        await client.disconnect()

    def _on_vehicles(self, _: object) -> None:
        self.scenes += 1
