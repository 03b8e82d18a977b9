"""A page without a browser: takes what the dashboard sends, and draws nothing."""

import asyncio
import os
import re
import threading
import urllib.request
import uuid
from collections.abc import Coroutine
from typing import Any
from urllib.parse import urlencode

import socketio

from crazyflie_dev.bench.row import NotMeasuredError

_LIMIT = 30.0  #: How long the dashboard may take to answer, s.
_NICENESS = 19  #: Of the thread: a browser on another computer takes nothing from this one.


class PageClient:
    """A page at an address such as http://127.0.0.1:8642, open for the time of a with block.

    It connects as NiceGUI's script in a browser does, and reads in a thread of its own.
    """

    def __init__(self, url: str):
        self.scenes = 0  #: Messages with the poses of all vehicles that have come.
        self._url = url
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._client = socketio.AsyncClient(reconnection=False)
        self._client.on("vehicles", self._on_vehicles)

    def __enter__(self) -> "PageClient":
        with urllib.request.urlopen(self._url, timeout=_LIMIT) as answer:
            found = re.search(r"'client_id': '([^']+)'", answer.read().decode())
        if found is None:
            raise NotMeasuredError(f"{self._url} is no page of NiceGUI 3: it names no client_id")
        self._thread.start()
        self._wait_for(self._connect(found[1]))
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._wait_for(self._client.disconnect())
        finally:
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_LIMIT)

    def _run(self) -> None:
        # In Linux the niceness is a thread's.
        os.nice(_NICENESS)
        self._loop.run_forever()

    def _wait_for(self, work: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result(_LIMIT)

    async def _connect(self, client_id: str) -> None:
        query = {
            "client_id": client_id,
            "document_id": uuid.uuid4(),
            "tab_id": uuid.uuid4(),
            "next_message_id": 0,
            "implicit_handshake": "true",
        }
        await self._client.connect(
            f"{self._url}/?{urlencode(query)}",
            headers={"Origin": self._url},
            transports=["websocket"],
            socketio_path="/_nicegui_ws/socket.io",
            wait_timeout=_LIMIT,
        )

    def _on_vehicles(self, _: object) -> None:
        self.scenes += 1
