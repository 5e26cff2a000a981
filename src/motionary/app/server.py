"""The page's server: who may connect, what may be sent to it, and what opens behind it."""

from __future__ import annotations

import errno
import signal
import socket
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import viser
from viser import _messages as messages
from viser.infra._infra import WebsockClientConnection

from motionary.app.panel import Panel
from motionary.app.work import MOST_BYTES, Workers
from motionary.dictionary.dictionary import load
from motionary.errors import InputError
from motionary.systems.registry import TEXT_TO_MOTION


class _Server(viser.ViserServer):
    origins: tuple[str, ...] = ()

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Never: any visitor could ask for a public tunnel to this machine."""
        return None

    async def turn_away(self, connection: WebsockClientConnection) -> None:
        """Closes what another site's page has opened; viser awaits this before it reads what was sent."""
        socket = self._websock_server._live_connections[connection.client_id]
        if socket.request is not None and not is_same_site(socket.request.headers, self.origins):
            site = socket.request.headers["Origin"]
            print(f"refused a connection from a page of {site}; --origin {site} would allow it", file=sys.stderr)
            await socket.close(1008, "opened by another site's page")


class App:
    """A running page. Each visitor has a panel and a scene of their own.

    Attributes:
        url: where it is.
    """

    def __init__(self, models: str | Path, device: str, host: str, port: int, origins: Sequence[str] = ()):
        """
        Args:
            models, device: see `motionary.load`.
            host: the address to listen on; 127.0.0.1 is reached from this machine alone.
            port: 0 takes any that is free.
            origins: sites ("https://motion.example.org") whose pages may connect besides this server's own.

        Raises:
            InputError: no models, or an address that cannot be had: what, value, rule.
        """
        self.dictionary = load(models, device)
        check_port(host, port)
        self.workers = Workers()
        self._panels: dict[int, Panel] = {}
        self.server = _Server(host=host, port=port, label="motionary", verbose=False)
        self.server.origins = tuple(origin.rstrip("/").lower() for origin in origins)
        self.server._websock_server.on_client_connect(self.server.turn_away)
        if port and self.server.get_port() != port:  # viser takes the next one where another program was faster
            self.close()
            raise InputError("--port", port, "in use; choose another")
        self.url = f"http://{'localhost' if host in ('0.0.0.0', '127.0.0.1') else host}:{self.server.get_port()}"
        self.server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        self.server.scene.set_up_direction("+y")
        self.server.scene.add_grid("/floor", width=30, height=30, plane="xz", cell_size=0.5, section_size=2.0)
        # The page draws labels only if it has one when it opens: this one, of a space, under the floor.
        self.server.scene.add_label("/floor/label", " ", position=(0.0, -1.0, 0.0))
        self.generators = self.dictionary.offering(TEXT_TO_MOTION)
        self.server.on_client_connect(self._welcome)
        self.server.on_client_disconnect(self._leave)
        threading.Thread(target=self._warm, daemon=True, name="warm").start()

    def close(self) -> None:
        """Stops serving."""
        for panel in list(self._panels.values()):
            panel.close()
        self.workers.close()
        self.server.stop()

    def _welcome(self, client: viser.ClientHandle) -> None:
        limit_uploads(client)
        self._panels[client.client_id] = Panel(client, self.dictionary, self.workers, self.generators)

    def _leave(self, client: viser.ClientHandle) -> None:
        if (panel := self._panels.pop(client.client_id, None)) is not None:
            panel.close()

    def _warm(self) -> None:
        """Opens behind the page what the first visitor will ask for, so that it answers at once."""
        try:
            for system in self.generators[:1]:
                self.dictionary.generate("a person walks", system=system, seconds=1)
        except Exception as error:  # it is said again, to whoever asks
            print(f"warning: {error}", file=sys.stderr)


def serve(models: str, device: str, host: str, port: int, origins: Sequence[str] = ()) -> None:
    """Serves until interrupted; see :class:`App`."""
    app = App(models, device, host, port, origins)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # as Ctrl-C: the workers end too
    print(f"motionary is at {app.url} (stop with Ctrl-C)", flush=True)
    try:
        threading.Event().wait()
    finally:
        app.close()


def check_port(host: str, port: int) -> None:
    """InputError where nothing can listen there."""
    if not 0 <= port < 65536:
        raise InputError("--port", port, "must be 0 to 65535")
    try:
        family, kind, proto, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, proto) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except socket.gaierror:
        raise InputError("--host", host, "must be an address of this machine") from None
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise InputError("--port", port, "in use; choose another") from None
        raise InputError("--host, --port", f"{host}:{port}", error.strerror or "cannot listen there") from None


def is_same_site(headers: Mapping[str, str], origins: Sequence[str] = ()) -> bool:
    """Whether a connection was opened by the page that this server sent, by one of `origins`, or by no browser.

    Browsers let any page open a WebSocket to any address, this machine's own among them, and name the page's site in
    Origin.
    """
    origin = headers.get("Origin", "").lower()
    return not origin or origin in origins or urlsplit(origin).netloc == headers.get("Host", "").lower()


def limit_uploads(client: viser.ClientHandle) -> None:
    """Drops a visitor's upload as soon as it says or shows that it is too large.

    viser has no such limit and keeps the parts in memory until the last has come; its handlers run in the order of
    registration, so these run after its own and drop what it has just noted.
    """
    pending: dict[str, Any] = client.gui._current_file_upload_states

    def drop(message: Any, size: int) -> None:
        """Forgets an upload of too many bytes, and says so."""
        if size <= MOST_BYTES or pending.pop(message.transfer_uuid, None) is None:
            return
        # The button waits until it hears that everything has arrived.
        done = {"transferred_bytes": size, "total_bytes": size}
        client._websock_connection.queue_message(
            messages.FileTransferPartAck(message.source_component_uuid, message.transfer_uuid, **done)
        )
        rule = f"{size / 2**20:.0f} MB: at most {MOST_BYTES // 2**20} MB can be read here"
        client.add_notification("The file was not taken", rule, color="red", auto_close_seconds=10)

    def started(_: int, message: messages.FileTransferStartUpload) -> None:
        """An upload says how large it is."""
        drop(message, message.size_bytes)

    def continued(_: int, message: messages.FileTransferPart) -> None:
        """A part of an upload has come."""
        state = pending.get(message.transfer_uuid)
        if state is not None:
            drop(message, state["transferred_bytes"])

    client._websock_connection.register_handler(messages.FileTransferStartUpload, started)
    client._websock_connection.register_handler(messages.FileTransferPart, continued)
