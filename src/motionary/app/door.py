"""Who may come in: requests are judged before anything is answered, pages and WebSockets alike."""

from __future__ import annotations

import http
import ipaddress
import re
import socket
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server as websocket_server
from websockets.datastructures import MultipleValuesError

_LARGEST = 2 * 2**20  # bytes of a message; the page sends files in parts of half a megabyte


def refusal(headers: Mapping[str, str], local: bool, origins: Sequence[str] = ()) -> str | None:
    """Why a request is refused; None: it is welcome.

    Browsers let any page open a WebSocket to any address, this machine's own among them, and name the page's site in
    Origin; programs name none.

    Args:
        headers: of the request, which may be for a page or to open a WebSocket.
        local: whether the server listens to this machine alone.
        origins: sites ("https://motion.example.org") that are trusted in addition to the server's own.
    """
    try:
        host, origin = headers.get("Host", "").lower(), headers.get("Origin", "").lower()
        upgrade = headers.get("Upgrade", "").lower()
    except MultipleValuesError:
        return "a header stands twice"
    if local and not is_local(host) and host not in (urlsplit(known).netloc for known in origins):
        return f"asked for {host[:100]!r}, which is not this machine; open localhost in its place"
    if upgrade and origin and origin not in origins and urlsplit(origin).netloc != host:
        return f"opened by a page of {origin[:100]}; --origin {origin[:100]} would allow it"
    return None


def is_local(host: str) -> bool:
    """Whether a Host header names this machine, with any port.

    A site may let its name point at 127.0.0.1 once its page is open; the browser then takes this server for that
    site, and Origin and Host agree. But Host still has the site's name.
    """
    return re.fullmatch(r"(localhost|127\.0\.0\.1|\[::1\])(:[0-9]+)?", host) is not None


def is_loopback(host: str) -> bool:
    """Whether an address that is listened on is reached from this machine alone."""
    found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    return all(ipaddress.ip_address(str(address[0]).partition("%")[0]).is_loopback for *_, address in found)


@contextmanager
def watched(local: bool, origins: Sequence[str]) -> Iterator[None]:
    """Servers that viser starts meanwhile refuse with 403 what `refusal` names, and messages that are too large.

    viser starts the server of websockets by itself and has no place for such a check, so it is put in where viser
    asks for that server.
    """
    original = websocket_server.serve

    def serve(*arguments: Any, process_request: Any, **options: Any) -> Any:
        """The same server with a check before viser's own handling."""

        def checked(connection: Any, request: Any) -> Any:
            """A refusal, or what viser answers."""
            why = refusal(request.headers, local, origins)
            if why is None:
                return process_request(connection, request)
            print(f"refused a connection: {why}", file=sys.stderr)
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"refused: {why}\n")

        return original(*arguments, process_request=checked, **{**options, "max_size": _LARGEST})

    websocket_server.serve = serve  # type: ignore[assignment]
    try:
        yield
    finally:
        websocket_server.serve = original  # type: ignore[assignment]
