"""A gate before viser's handling of uploads, which has no limits and keeps the parts in memory until the last comes."""

from __future__ import annotations

from typing import Any

import viser
from viser._messages import FileTransferPart, FileTransferPartAck, FileTransferStartUpload

from motionary.app.limits import MOST_BYTES, MOST_PARTS, MOST_UNFINISHED


def limit_uploads(client: viser.ClientHandle) -> None:
    """Lets through only uploads that a visitor may send; the others are dropped, and the visitor is told why.

    What a visitor has not finished sending is at most `MOST_BYTES` in at most `MOST_UNFINISHED` files; viser drops it
    when the visitor leaves.
    """
    gui, connection = client.gui, client._websock_connection
    pending: dict[str, Any] = gui._current_file_upload_states

    def started(visitor: Any, message: FileTransferStartUpload) -> None:
        """An upload says how large it will be."""
        if not _is_upload_button(gui, message.source_component_uuid) or message.transfer_uuid in pending:
            return
        why = _refusal(message, pending)
        if why is None:
            gui._handle_file_transfer_start(visitor, message)
        else:
            _tell(client, message, why)

    def continued(visitor: Any, message: FileTransferPart) -> None:
        """A part of an upload has come."""
        state = pending.get(message.transfer_uuid)
        if state is None:
            return
        if not isinstance(message.content, bytes) or not _is_upload_button(gui, message.source_component_uuid):
            del pending[message.transfer_uuid]
        elif state["transferred_bytes"] + len(message.content) > state["total_bytes"]:
            del pending[message.transfer_uuid]
            _tell(client, message, "it is larger than it said")
        else:
            gui._handle_file_transfer_part(visitor, message)

    connection.unregister_handler(FileTransferStartUpload)  # viser's own
    connection.unregister_handler(FileTransferPart)
    connection.register_handler(FileTransferStartUpload, started)
    connection.register_handler(FileTransferPart, continued)


def take(button: viser.GuiUploadButtonHandle) -> viser.UploadedFile:
    """Takes the file that was sent to a button out of the button, which would keep it in memory."""
    file, button._impl.value = button.value, viser.UploadedFile("", b"")
    return file


def _refusal(message: FileTransferStartUpload, pending: dict[str, Any]) -> str | None:
    """Why an upload may not begin; None: it may."""
    size, parts = message.size_bytes, message.part_count
    if size < 0 or not 0 <= parts <= MOST_PARTS:
        return "it does not say how large it is"
    if size > MOST_BYTES:
        return f"{size / 2**20:.0f} MB: at most {MOST_BYTES // 2**20} MB can be read here"
    if len(pending) >= MOST_UNFINISHED:
        return f"at most {MOST_UNFINISHED} files at a time; wait for the others"
    if size + sum(state["total_bytes"] for state in pending.values()) > MOST_BYTES:
        return f"at most {MOST_BYTES // 2**20} MB at a time; wait for the others"
    return None


def _is_upload_button(gui: viser.GuiApi, uuid: Any) -> bool:
    """Whether a control takes files; viser would hand a file to any, a slider too."""
    return isinstance(uuid, str) and isinstance(gui._gui_input_handle_from_uuid.get(uuid), viser.GuiUploadButtonHandle)


def _tell(client: viser.ClientHandle, message: FileTransferStartUpload | FileTransferPart, why: str) -> None:
    # The button waits until it hears that everything has arrived.
    source, transfer = message.source_component_uuid, message.transfer_uuid
    done = FileTransferPartAck(source, transfer, transferred_bytes=1, total_bytes=1)
    client._websock_connection.queue_message(done)
    client.add_notification("The file was not taken", why, color="red", auto_close_seconds=10)
