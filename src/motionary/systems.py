"""The trained systems of a folder, each loaded when it is first asked."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from threading import RLock
from typing import Any, TypeVar

from motionary.corpus.context import Context
from motionary.errors import InputError

T = TypeVar("T")


class Systems:
    """A folder of trained systems and those of them that have been loaded, once for all threads.

    Attributes:
        models: the folder.
    """

    def __init__(self, models: Path, device: str = "auto"):
        self.models, self._device = models, device
        self._opened: dict[tuple[str, str], Any] = {}
        self._lock = RLock()

    @property
    def systems(self) -> tuple[str, ...]:
        """Names of what lies in the folder."""
        return tuple(sorted(f.name for f in self.models.iterdir() if f.is_dir() and not f.name.startswith(".")))

    def context(self, system: str) -> Context:
        """What a system knows of its data: skeleton, rate, codec, vocabulary."""
        from motionary.models.io import CONFIG_FILE, read_record

        # What brings no config of its own (search) lives in the evaluator's space.
        name = system if (self.models / system / CONFIG_FILE).is_file() else "evaluator"
        if not (self.models / name).is_dir():
            raise self._absent(name)
        return self._once(name, "context", lambda: Context.from_json(read_record(self.models / name)["context"]))

    def _open(self, name: str, opener: str) -> Any:
        if not (self.models / name).is_dir():
            raise self._absent(name)
        try:
            module = import_module(f"motionary.models.{name}")
        except ModuleNotFoundError:
            raise InputError("system", name, f"must be one of {', '.join(self.systems)}") from None
        if not hasattr(module, opener):
            rule = "does not turn text into motion" if opener == "open_generator" else "does not turn motion into text"
            raise InputError("system", name, rule)
        return self._once(name, opener, lambda: getattr(module, opener)(self.models, self._on()))

    def _on(self) -> str:
        """The device to run on."""
        from motionary.models.io import choose_device

        return choose_device(self._device)

    def _judge(self) -> Any:
        from motionary.models.judge import Judge

        self.context("evaluator")  # names the stage where the evaluator is missing
        return self._once("evaluator", "judge", lambda: Judge(self.models, self._on()))

    def _once(self, name: str, what: str, build: Callable[[], T]) -> T:
        with self._lock:
            if (name, what) not in self._opened:
                self._opened[name, what] = build()
            return self._opened[name, what]

    def _absent(self, name: str) -> InputError:
        return InputError("system", name, f"not part of these models; run `dvc repro {name}`")
