"""Admits only requests that may see the page, and tells browsers what the page may load."""

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from crazyflie_dashboard.access import Access

HEADERS = (
    # Nothing from the internet, and no frame around the page (which could redirect clicks).
    (
        b"content-security-policy",
        b"default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; frame-ancestors 'none'; "
        b"base-uri 'none'; form-action 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
)


class Gate:
    """ASGI application around another one: refuses requests and websockets as `Access` decides.

    A token in the address becomes a cookie, so that it does not stay in the address bar.
    """

    def __init__(self, app: ASGIApp, access: Access):
        self.app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or refuse it."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        request = HTTPConnection(scope)
        headers = dict(request.headers)
        if scope["type"] == "websocket":
            headers["upgrade"] = "websocket"
        given = request.query_params.get("token", "")
        refusal = self._access.refusal(headers, given)
        if refusal and scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": refusal[:120]})
        elif refusal:
            await PlainTextResponse(f"Refused: {refusal}.\n", 403)(scope, receive, send)
        elif given and scope["type"] == "http":
            # Redirect to this page: a path such as //another.example/ would lead to another server.
            answer = RedirectResponse("/", 303)
            answer.set_cookie(self._access.cookie, given, httponly=True, samesite="strict")
            await answer(scope, receive, send)
        else:
            await self.app(scope, receive, _with_headers(send))


def _with_headers(send: Send) -> Send:
    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *HEADERS]
        await send(message)

    return sender
