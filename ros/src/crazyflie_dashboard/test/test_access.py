"""Access: which requests are answered."""

import os
import socket
from pathlib import Path
from xml.etree import ElementTree

import pytest

from crazyflie_dashboard.access import Access, AccessError, expect_free_port, token_in

TOKEN = "0123456789abcdef"


def headers(host="127.0.0.1:8642", origin="http://127.0.0.1:8642", **others):
    fields = {"host": host, "upgrade": "websocket", **others}
    return fields if origin is None else {**fields, "origin": origin}


@pytest.fixture
def access():
    return Access("127.0.0.1", 8642)


@pytest.mark.parametrize("host", ["127.0.0.1:8642", "localhost:8642", "[::1]:8642"])
def test_the_page_itself_is_let_in(access, host):
    assert access.refusal(headers(host, f"http://{host}")) == ""


def test_a_page_is_loaded_without_an_origin(access):
    assert access.refusal({"Host": "127.0.0.1:8642"}) == ""


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "http://127.0.0.1:8643",
        "http://127.0.0.1.evil.example:8642",
        "null",
        "",
        "file://",
        "http://localhost:8642",
        None,
    ],
)
def test_a_websocket_of_another_origin_is_refused(access, origin):
    assert "Origin" in access.refusal(headers(origin=origin))


@pytest.mark.parametrize(
    "host", ["evil.example:8642", "127.0.0.1", "127.0.0.1:80", "", "127.0.0.1:99999", "[:8642"]
)
def test_a_name_that_was_bound_to_this_computer_is_refused(access, host):
    assert "Host" in access.refusal(headers(host, f"http://{host}"))


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.7", "lab", "::"])
def test_other_computers_need_a_token(host):
    with pytest.raises(AccessError, match="expected a token"):
        Access(host, 8642)
    access = Access(host, 8642, TOKEN)
    asked = headers("lab:8642", "http://lab:8642")
    assert access.refusal(asked, TOKEN) == ""
    for wrong in ("", TOKEN[:-1], TOKEN + "f", "é" * 16):
        assert "token" in access.refusal(asked, wrong)
    assert "Origin" in access.refusal(headers("lab:8642", "http://evil.example"), TOKEN)
    assert TOKEN in access.url


@pytest.mark.parametrize(
    "others", ["a=b", 'x={"a": 1, "b"}; é; =', "dashboard_token_80=of another port"]
)
def test_a_cookie_may_have_the_token_whatever_other_sites_have_set(others):
    access = Access("0.0.0.0", 8642, TOKEN)
    own = f"{access.cookie}={TOKEN}"
    for cookies in (f"{others}; {own}", f"{own}; {others}", f"{access.cookie}=wrong; {own}"):
        asked = headers("lab:8642", "http://lab:8642", cookie=cookies)
        assert access.refusal(asked) == ""
    assert access.refusal(headers("lab:8642", "http://lab:8642", cookie=others)) != ""


def fetch(site, mode="navigate", destination="document"):
    fetched = {"sec-fetch-site": site, "sec-fetch-mode": mode, "sec-fetch-dest": destination}
    return {"Host": "127.0.0.1:8642", **fetched}


def test_what_another_site_loads_is_refused_and_a_link_to_the_page_is_not(access):
    for site in ("cross-site", "same-site"):
        assert "another site" in access.refusal(fetch(site, "no-cors", "image"))
        assert "another site" in access.refusal(fetch(site, "navigate", "iframe"))
        assert access.refusal(fetch(site)) == ""
    assert access.refusal(fetch("none")) == access.refusal(fetch("same-origin", "cors", "")) == ""


def test_the_token_is_in_a_file_of_the_user_only(tmp_path):
    path = tmp_path / "folder" / "token"
    token = token_in(path)
    assert (token_in(path), len(token) >= 16) == (token, True)
    assert path.stat().st_mode & 0o777 == 0o600
    path.chmod(0o644)
    with pytest.raises(AccessError, match="others may read .*; expected mode 600"):
        token_in(path)


def test_no_token_is_given_where_others_can_read_it():
    # The command line of roslaunch, and the parameter server.
    launch = ElementTree.parse(Path(__file__).parents[1] / "launch" / "dashboard.launch")
    names = {each.get("name") for each in launch.iter() if each.tag in ("arg", "param")}
    assert names == {"host", "port", "token_file", "folders", "goal_limit"}


def test_short_tokens_are_refused():
    with pytest.raises(AccessError, match="the token has 5 characters"):
        Access("0.0.0.0", 8642, "short")


def test_who_uses_a_port_is_reported():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(AccessError) as error:
            expect_free_port("127.0.0.1", port)
    text = str(error.value)
    assert f"port {port}" in text
    assert f"process {os.getpid()} (" in text
    free = int(text.rpartition("port:=")[2])
    expect_free_port("127.0.0.1", free)


def test_an_address_of_another_computer_is_refused():
    with pytest.raises(AccessError, match="expected an address of this computer"):
        expect_free_port("192.0.2.1", 8642)
