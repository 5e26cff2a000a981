"""A visitor without a browser: speaks to a running page over its real WebSocket, as the page's script does."""

from __future__ import annotations

import time
from typing import Any

import msgspec
import viser
import zstandard
from viser import _messages as messages
from websockets.sync.client import connect

PATIENCE = 60.0  # seconds


def options() -> dict[str, Any]:
    """Of every connection to a page."""
    return {
        "subprotocols": [f"viser-v{viser.__version__}"],
        "max_size": None,
        "max_queue": None,
        "open_timeout": PATIENCE,
    }


class Visitor:
    """One connection.

    Attributes:
        controls: the id of each control, by its label; of several with one label the newest.
        forms: the ids of the groups of controls in which Enter asks.
        notes, texts, files: what the page has shown as notes and as text, and the names of files it was sent.
    """

    def __init__(self, url: str):
        self._socket = connect(url.replace("http", "ws", 1), **options())
        self.controls: dict[str, str] = {}
        self.forms: list[str] = []
        self.notes: list[str] = []
        self.texts: list[str] = []
        self.files: list[str] = []
        one, none = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        self.send(messages.ViewerCameraMessage(one, (0.0, 1.0, 3.0), 1.0, 0.1, 100.0, 480, 640, none, (0.0, 1.0, 0.0)))

    def send(self, message: Any, **changed: Any) -> None:
        """Hands a message to the server, with some values that its type does not allow."""
        self._socket.send(msgspec.msgpack.encode({**message.as_serializable_dict(), **changed}))

    def until(self, holds: Any, what: str, seconds: float = PATIENCE) -> None:
        """Reads what comes until something holds; AssertionError where it does not in time."""
        end = time.monotonic() + seconds
        while not holds():
            left = end - time.monotonic()
            assert left > 0, f"never came: {what}; notes: {self.notes}, texts: {self.texts[-5:]}"
            try:
                self._read(self._socket.recv(timeout=left))
            except TimeoutError:
                continue

    def ask(self, label: str, value: Any = True) -> None:
        """Sets a control, or presses a button."""
        self.until(lambda: label in self.controls, f"the control {label}")
        self.send(messages.GuiUpdateMessage(self.controls[label], {"value": value}))

    def enter(self, form: int = 0) -> None:
        """Presses Enter in a group of controls."""
        self.until(lambda: len(self.forms) > form, f"form {form}")
        self.send(messages.GuiFormSubmitMessage(self.forms[form]))

    def says(self, *parts: str) -> None:
        """Waits for a text that holds all of these."""
        self.until(lambda: any(all(part in text for part in parts) for text in self.texts), " ... ".join(parts))

    def begin_upload(self, label: str, name: str, size: int, parts: int = 1) -> str:
        """Announces a file for a button; returns the upload's id."""
        self.until(lambda: label in self.controls, f"the control {label}")
        transfer = f"{name}-{time.monotonic_ns()}"
        self.send(messages.FileTransferStartUpload(self.controls[label], transfer, name, "", parts, size))
        return transfer

    def send_part(self, label: str, transfer: str, index: int, content: Any) -> None:
        """Sends a part of a file."""
        self.send(messages.FileTransferPart(self.controls[label], transfer, index, b""), content=content)

    def upload(self, label: str, name: str, content: bytes) -> None:
        """Sends a whole file."""
        self.send_part(label, self.begin_upload(label, name, len(content)), 0, content)

    def close(self) -> None:
        """Leaves."""
        self._socket.close()

    def _read(self, raw: str | bytes) -> None:
        assert isinstance(raw, bytes)
        packed = int.from_bytes(raw[8:16], "little")
        window = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed]))
        for message in window["messages"]:
            kind, props = message["type"], message.get("props") or message.get("updates") or {}
            if kind == "NotificationShowMessage":
                self.notes.append(f"{props['title']}: {props['body']}")
            elif kind == "FileTransferStartDownload":
                self.files.append(message["filename"])
            elif "_markdown" in props:
                self.texts.append(props["_markdown"])
            elif kind == "GuiFormMessage":
                self.forms.append(message["uuid"])
            elif kind.startswith("Gui") and props.get("label"):
                self.controls[props["label"]] = message["uuid"]
