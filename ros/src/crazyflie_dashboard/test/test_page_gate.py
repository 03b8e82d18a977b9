"""Who may see the page: requests and websockets of other origins, with and without a token."""

import pytest
from starlette.responses import PlainTextResponse
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from crazyflie_dashboard.access import Access
from crazyflie_dashboard.page.gate import Gate

TOKEN = "a token that was printed"
HOST = "127.0.0.1:8642"


async def application(scope, receive, send):
    if scope["type"] == "http":
        await PlainTextResponse("the page")(scope, receive, send)
    else:
        await receive()
        await send({"type": "websocket.accept"})
        await send({"type": "websocket.close", "code": 1000})


def client(token=""):
    return TestClient(
        Gate(application, Access("127.0.0.1", 8642, token)),
        base_url=f"http://{HOST}",
        follow_redirects=False,
    )


def websocket_is_accepted(client, origin):
    headers = {"origin": origin} if origin else {}
    try:
        with client.websocket_connect(f"ws://{HOST}/", headers=headers) as connection:
            with pytest.raises(WebSocketDisconnect):
                connection.receive_text()
            return True
    except WebSocketDisconnect as refused:
        assert refused.code == 1008
        return False


def test_the_page_of_this_computer_is_shown_without_a_frame_around_it():
    answer = client().get("/")
    assert answer.text == "the page"
    assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
    assert websocket_is_accepted(client(), f"http://{HOST}")


@pytest.mark.parametrize("origin", ["http://hostile.example", "http://127.0.0.1:80", "null", None])
def test_a_websocket_of_another_origin_is_refused(origin):
    assert not websocket_is_accepted(client(), origin)


def test_a_name_that_was_made_to_resolve_to_this_computer_is_refused():
    answer = client().get("/", headers={"host": "hostile.example:8642"})
    assert (answer.status_code, "hostile.example" in answer.text) == (403, True)


def test_a_token_is_asked_for_and_becomes_a_cookie():
    browser = client(TOKEN)
    assert browser.get("/").status_code == 403
    assert browser.get("/?token=another").status_code == 403
    assert not websocket_is_accepted(browser, f"http://{HOST}")
    answer = browser.get("/", params={"token": TOKEN})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    assert "httponly" in answer.headers["set-cookie"].lower()
    assert browser.get("/").text == "the page"
    assert websocket_is_accepted(browser, f"http://{HOST}")


def test_a_token_in_an_address_leads_to_this_page_only():
    answer = client(TOKEN).get(f"http://{HOST}//evil.example/", params={"token": TOKEN})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
