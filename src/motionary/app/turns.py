"""One visitor's turns: a job at a time, a sign of what is being done, mistakes told in one line."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from typing import Any

from motionary.app.work import Workers
from motionary.errors import InputError

READY = "Ready."
_GRACE = 2.0  # seconds: who has just got a file may ask for the next before the turn of the first is over


class Turns:
    """Runs what a visitor asks for, one job at a time, in the shared workers; ends it when the visitor leaves.

    Attributes:
        asked: whether the visitor has asked for anything yet.
    """

    def __init__(self, client: Any, workers: Workers):
        self._client, self._workers = client, workers
        self._busy, self._closed, self.asked = threading.Lock(), False, False
        self._sign = client.gui.add_markdown(READY)

    def start(self, sign: str, job: Callable[[], None]) -> None:
        """Runs a job unless this visitor has one running; the page answers meanwhile."""
        self.asked = True
        if not self._busy.acquire(timeout=_GRACE):
            self.complain("One thing at a time", "What you asked before is still being done.")
            return

        def run() -> None:
            """The job, then readiness for the next."""
            try:
                self.guarded(job)
            finally:
                if self._sign.content.startswith("⏳"):
                    self.say(READY)
                self._busy.release()

        self.say(f"⏳ {sign} ...")
        if not self._workers.submit(run):
            self.say(READY)
            self._busy.release()
            self.complain("Too many visitors", "Please try again in a minute.")

    def submit(self, job: Callable[[], None]) -> None:
        """Runs a job beside the visitor's turns, or not at all where too many wait already."""
        self._workers.submit(lambda: self.guarded(job))

    def guarded(self, job: Callable[[], None]) -> None:
        """A visitor's mistake becomes one line on the page; anything else is logged, and told without details."""
        if self._closed:
            return
        try:
            job()
        except InputError as error:
            self.complain("That does not work", str(error))
        except Exception:
            if not self._closed:
                traceback.print_exc()
                self.complain("Something went wrong", "The server's log says what.")

    def on_models(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """What the models answer; waits for their turn. See :meth:`Workers.on_models`."""
        return self._workers.on_models(self._stays, function, *arguments)

    def in_process(self, queue: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """What a process of its own answers; waits for its turn. See :meth:`Workers.in_process`."""
        return self._workers.in_process(queue, self._stays, function, *arguments)

    def say(self, text: str) -> None:
        """Shows a line."""
        self._sign.content = text

    def complain(self, title: str, text: str) -> None:
        """Shows a note that goes by itself."""
        self._client.add_notification(title, text[:500], color="red", auto_close_seconds=10.0)

    def close(self) -> None:
        """Drops what has not begun, and ends what runs in a process."""
        self._closed = True

    def _stays(self) -> bool:
        return not self._closed
