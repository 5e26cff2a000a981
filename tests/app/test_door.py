"""Who may come in: pages and WebSockets asked for under another name, or by another site, are refused."""

from __future__ import annotations

import http.client
import socket

import pytest
from visitor import options
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from motionary.app import server
from motionary.app.door import is_local, is_loopback, refusal


@pytest.fixture(scope="module")
def app(pipeline):
    app = server.App(pipeline / "models", "cpu", "127.0.0.1", 0, ["https://Motion.example.org/"])
    yield app
    app.close()


def port_of(app: server.App) -> int:
    return int(app.url.rpartition(":")[2])


def fetched(app: server.App, host: str | None, path: str = "/") -> tuple[int, bytes]:
    """Status and body of a page asked for under a Host; None sends none."""
    connection = http.client.HTTPConnection("127.0.0.1", port_of(app), timeout=60)
    connection.putrequest("GET", path, skip_host=True)
    if host is not None:
        connection.putheader("Host", host)
    connection.endheaders()
    answer = connection.getresponse()
    return answer.status, answer.read()


def opened(app: server.App, host: str, origin: str | None = None) -> int:
    """Status with which a WebSocket is answered that is asked for under a Host; 101 only once it brings something."""
    here = socket.create_connection(("127.0.0.1", port_of(app)), timeout=60)
    try:
        with connect(f"ws://{host}/", sock=here, origin=origin, **options()) as opened:
            assert opened.recv(timeout=60)
            return 101
    except InvalidStatus as refused:
        return refused.response.status_code


def test_pages_are_sent_to_this_machine_s_names_alone(app):
    port = port_of(app)
    for host in (
        "localhost",
        f"localhost:{port}",
        f"127.0.0.1:{port}",
        "[::1]:1",
        "LOCALHOST:80",
        "motion.example.org",
    ):
        status, body = fetched(app, host)
        assert (status, b"<html" in body) == (200, True), host
    for host in ("evil.example", f"evil.example:{port}", "localhost.evil.example", "127.0.0.1.nip.io", "", None):
        for path in ("/", "/nothing"):
            status, body = fetched(app, host, path)
            assert (status, b"<html" in body) == (403, False), host


def test_websockets_are_opened_under_this_machine_s_names_alone(app, capsys):
    port = port_of(app)
    assert [opened(app, f"{name}:{port}") for name in ("localhost", "127.0.0.1", "[::1]")] == [101] * 3
    # What a site reaches whose name points at 127.0.0.1 since a moment ago: Origin and Host agree.
    assert opened(app, f"evil.example:{port}", f"http://evil.example:{port}") == 403
    assert "open localhost in its place" in capsys.readouterr().err


def test_a_page_of_another_site_is_turned_away(app):
    host = f"localhost:{port_of(app)}"
    assert [opened(app, host, origin) for origin in (None, app.url, "https://motion.example.org")] == [101] * 3
    for origin in ("https://example.com", app.url.replace("localhost", "localhost.example.com"), "null"):
        assert opened(app, host, origin) == 403


def test_a_server_for_all_answers_to_any_name_and_still_not_to_other_sites():
    assert refusal({"Host": "motion.lan:9000"}, local=False) is None
    own = {"Host": "motion.lan:9000", "Upgrade": "websocket", "Origin": "http://motion.lan:9000"}
    assert refusal(own, local=False) is None
    assert "opened by a page of" in str(refusal({**own, "Origin": "http://other.lan"}, local=False))


@pytest.mark.parametrize("host", ["localhost:", "localhost:8x", "localhost:80:80", "::1", "127.0.0.2", "localhost\n"])
def test_what_only_looks_local_is_not(host):
    assert not is_local(host)


def test_only_loopback_addresses_are_reached_from_this_machine_alone():
    assert [is_loopback(host) for host in ("127.0.0.1", "localhost", "127.0.0.9", "::1")] == [True] * 4
    assert not any(is_loopback(host) for host in ("0.0.0.0", "::", "192.0.2.1"))
