"""The page's server: who may connect, what may be sent to it, and what opens behind it."""

from __future__ import annotations

import errno
import signal
import socket
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path

import viser

from motionary.app.door import is_loopback, watched
from motionary.app.opening import Opening
from motionary.app.panel import Panel
from motionary.app.uploads import limit_uploads
from motionary.app.work import Workers
from motionary.dictionary.dictionary import load
from motionary.errors import InputError
from motionary.systems.registry import TEXT_TO_MOTION


class _Server(viser.ViserServer):
    def request_share_url(self, verbose: bool = True) -> str | None:
        """Never: any visitor could ask for a public tunnel to this machine."""
        return None


class App:
    """A running page. Each visitor has a panel and a scene of their own.

    Attributes:
        url: where it is.
    """

    def __init__(self, models: str | Path | None, device: str, host: str, port: int, origins: Sequence[str] = ()):
        """
        Args:
            models, device: see `motionary.load`.
            host: the address to listen on; 127.0.0.1 is reached from this machine alone.
            port: 0 takes any that is free.
            origins: sites ("https://motion.example.org") whose pages may connect in addition to this server's own.

        Raises:
            InputError: no models, or an address that cannot be had: what, value, rule.
        """
        self.dictionary = load(models, device)
        check_port(host, port)
        self.workers = Workers()
        self._panels: dict[int, Panel] = {}
        with watched(is_loopback(host), [origin.rstrip("/").lower() for origin in origins]):
            self.server = _Server(host=host, port=port, label="motionary", verbose=False)
        if port and self.server.get_port() != port:  # viser takes the next one where another program was faster
            self.close()
            raise InputError("--port", port, "in use; choose another")
        shown = "localhost" if host in ("0.0.0.0", "127.0.0.1") else f"[{host}]" if ":" in host else host
        self.url = f"http://{shown}:{self.server.get_port()}"
        self.server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()  # beside the motions, not above them
        self.server.scene.set_up_direction("+y")
        # The page draws labels only if it has one when it opens: this one, of a space, under the floor.
        self.server.scene.add_label("/label", " ", position=(0.0, -1.0, 0.0))
        self.generators = self.dictionary.offering(TEXT_TO_MOTION)
        self.opening = Opening(self.dictionary, self.generators)
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
        panel = Panel(client, self.dictionary, self.workers, self.generators, self.opening)
        self._panels[client.client_id] = panel
        # Who leaves at once may be gone before the panel is there, and then nothing else closes it.
        if client.client_id not in self.server.get_clients():
            self._leave(client)

    def _leave(self, client: viser.ClientHandle) -> None:
        if (panel := self._panels.pop(client.client_id, None)) is not None:
            panel.close()

    def _warm(self) -> None:
        """Opens behind the page what the first visitor will see, so that it is there at once."""
        with suppress(CancelledError, RuntimeError):  # closed before its turn
            self.workers.on_models(lambda: True, self.opening.items)


def serve(models: str | None, device: str, host: str, port: int, origins: Sequence[str] = ()) -> None:
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
    except (socket.gaierror, UnicodeError):
        raise InputError("--host", host, "must be an address of this machine") from None
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise InputError("--port", port, "in use; choose another") from None
        raise InputError("--host, --port", f"{host}:{port}", error.strerror or "cannot listen there") from None
