"""Selects the requests that the page answers: from its own pages, or with a token."""

import contextlib
import hmac
import ipaddress
import os
import secrets
import socket
from collections.abc import Iterator, Mapping
from pathlib import Path
from urllib.parse import urlsplit

MIN_TOKEN_LENGTH = 16

_LISTENING = "0A"  #: State of a listening socket in /proc/net/tcp.


class AccessError(Exception):
    """The page cannot be offered at this address; the text says why."""


class Access:
    """Decides about requests of one page.

    A page from another origin in the same browser is refused by its Origin, one whose name was made
    to resolve to this computer (DNS rebinding) by its Host.

    ``host`` is the address or name on which the page listens; the token is needed unless that is
    this computer's own.

    `AccessError`: the address needs a token, and the token is missing or too short.
    """

    def __init__(self, host: str, port: int, token: str = ""):
        self.host, self.port, self.token = host, port, token
        #: Name of the cookie with the token; it contains the port, since a browser sends the
        #: cookies of all ports of a computer.
        self.cookie = f"dashboard_token_{port}"
        if token and len(token) < MIN_TOKEN_LENGTH:
            raise AccessError(
                f"the token has {len(token)} characters; expected at least {MIN_TOKEN_LENGTH}"
            )
        if not token and not is_loopback(host):
            raise AccessError(f"host is {host}, which other computers can reach; expected a token")

    @property
    def url(self) -> str:
        """Address of the page, with its token."""
        # A browser cannot open this address.
        host = socket.gethostname() if self.host in ("0.0.0.0", "::", "") else self.host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/" + (f"?token={self.token}" if self.token else "")

    def refusal(self, headers: Mapping[str, str], token: str = "") -> str:
        """Return why a request is refused; "" if it is not.

        The headers are those of an HTTP request, also of one that opens a websocket; without a
        token of its address, that of its cookie is used.
        """
        fields = {name.lower(): value for name, value in headers.items()}
        host, origin = fields.get("host", ""), fields.get("origin")
        if not self._is_own_host(host):
            return f"the Host is {host!r}; expected that of the page"
        is_websocket = fields.get("upgrade", "").lower() == "websocket"
        if origin is None and is_websocket:
            return "a websocket without an Origin; expected that of the page"
        if origin is not None and origin.lower() not in {
            f"{scheme}://{host.lower()}" for scheme in ("http", "https")
        }:
            return f"the Origin is {origin!r}; expected that of the page"
        is_opened = (fields.get("sec-fetch-mode"), fields.get("sec-fetch-dest")) == (
            "navigate",
            "document",
        )
        if fields.get("sec-fetch-site", "none") not in ("none", "same-origin") and not is_opened:
            return "another site has asked for it; expected the page, or a link that is followed"
        given = [token] if token else self._cookies(fields.get("cookie", ""))
        if self.token and not any(
            hmac.compare_digest(self.token.encode(), each.encode()) for each in given
        ):
            return "the token is missing or wrong; it was printed when the dashboard began"
        return ""

    def _cookies(self, text):
        # Other cookies may contain anything, and http.cookies stops at invalid ones.
        pairs = (each.strip().partition("=") for each in text.split(";"))
        return [value.strip('"') for name, _, value in pairs if name == self.cookie]

    def _is_own_host(self, text):
        try:
            parts = urlsplit(f"//{text}")
            name, port = parts.hostname or "", parts.port or 80
        except ValueError:
            return False
        if port != self.port:
            return False
        # Other computers may know this one by any name, so the token decides.
        return bool(name) and (not is_loopback(self.host) or is_loopback(name))


def is_loopback(host: str) -> bool:
    """Tell whether an address or name is this computer's own, which no other one reaches."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def token_in(path: Path) -> str:
    """Return the token in a file, which is created if it is missing; only its user may read it.

    `AccessError`: others may read it, or it cannot be read or made.
    """
    try:
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(secrets.token_urlsafe(MIN_TOKEN_LENGTH))
        mode = path.stat().st_mode & 0o777
        if mode & 0o077:
            raise AccessError(f"others may read {path}, whose mode is {mode:o}; expected mode 600")
        return path.read_text().strip()
    except OSError as error:
        raise AccessError(f"the token's file {path}: {error.strerror}") from None


def expect_free_port(host: str, port: int) -> None:
    """Raise `AccessError` if a port is in use, with the process that uses it, and a free one."""
    try:
        _bind(host, port)
    except OSError as error:
        with contextlib.suppress(OSError):
            free = _bind(host, 0)
            user = next(_users(port), "a process of another user")
            raise AccessError(
                f"port {port} of {host} is in use by {user}; expected a free one, such as "
                f"port:={free}"
            ) from error
        raise AccessError(
            f"host is {host}: {error}; expected an address of this computer"
        ) from None


def _bind(host, port):
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen()
        return listener.getsockname()[1]


def _users(port: int) -> Iterator[str]:
    """Yield the processes that listen on a TCP port, as far as this user may know them."""
    inodes = set()
    for table in (Path("/proc/net/tcp"), Path("/proc/net/tcp6")):
        rows = table.read_text().splitlines()[1:] if table.exists() else []
        for row in map(str.split, rows):
            if row[3] == _LISTENING and int(row[1].rpartition(":")[2], 16) == port:
                inodes.add(f"socket:[{row[9]}]")
    for process in Path("/proc").glob("[0-9]*"):
        # It may end meanwhile, or be another user's.
        with contextlib.suppress(OSError):
            if any(os.readlink(each) in inodes for each in (process / "fd").iterdir()):
                command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode().strip()
                yield f"process {process.name} ({command[:80]})"
