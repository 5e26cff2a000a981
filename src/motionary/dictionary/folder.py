"""The trained systems of a folder, each loaded when it is first asked."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from threading import RLock
from typing import Any, TypeVar

from motionary.corpus.context import Context
from motionary.dictionary.places import VARIABLE
from motionary.errors import InputError
from motionary.systems.protocols import TextMotionJudge
from motionary.systems.registry import EMBED, TELLS, find, known, offering
from motionary.systems.serving import served_by

T = TypeVar("T")
BEST = "preferred.json"  # what the report found best
MANIFEST = "bundle.json"  # what `motionary bundle` says of its systems


class Folder:
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
        """Names of the systems that lie in the folder; what else lies there is left alone."""
        return tuple(sorted(name for name in known() if (self.models / name).is_dir()))

    def context(self, system: str) -> Context:
        """What a system knows of its data: skeleton, rate, codec, vocabulary."""
        from motionary.systems.io import CONFIG_FILE, read_record, roles

        # What brings no config of its own knows what the system knows in whose space it lives.
        names = served_by([system], lambda name: roles(self.models / name))[::-1]
        name = next((n for n in names if (self.models / n / CONFIG_FILE).is_file()), None)
        if name is None:
            raise self._absent(next((n for n in names if n not in self.systems), system))
        return self._once(name, "context", lambda: Context.from_json(read_record(self.models / name)["context"]))

    def offering(self, offer: str) -> tuple[str, ...]:
        """Names of the systems of the folder that offer something, the usual one first; opens none of them. Usual is
        the one that the report found best, where there is a report, else the registry's."""
        withheld = self._manifest.get("withheld") or {}
        found = [name for name in offering(offer, self.systems) if offer not in withheld.get(name, ())]
        return tuple(sorted(found, key=lambda name: name != self._best.get(offer)))

    @cached_property
    def _best(self) -> dict[str, Any]:
        """What ``preferred.json`` says, among the models or in the reports beside them."""
        files = (self.models / BEST, self.models.parent / "reports" / BEST)
        return next((_read(file, "the report") for file in files if file.is_file()), {})

    @cached_property
    def _manifest(self) -> dict[str, Any]:
        """What ``bundle.json`` says, where the folder is a bundle."""
        file = self.models / MANIFEST
        found = _read(file, "`motionary bundle`") if file.is_file() else {}
        kept = found.get("withheld") or {}
        if not isinstance(kept, dict) or not all(isinstance(offers, list) for offers in kept.values()):
            raise InputError(f"{file}, withheld", kept, "must be lists of what systems do not offer, by system")
        return found

    def first_of(self, *offers: str) -> str:
        """The usual system of the first of these offers that the folder has, else any that it has."""
        found = (name for offer in offers for name in self.offering(offer))
        return next(found, next(iter(self.systems)))

    def _open(self, offer: str, name: str | None = None) -> Any:
        """What the system `name`, or the usual one of the folder, offers."""
        from motionary.systems.io import open_system

        here = self.offering(offer)
        if name is not None and (not isinstance(name, str) or name not in known()):
            rule = f"must be one of {', '.join(here)}" if here else f"none of these models can {TELLS[offer]}"
            raise InputError("system", name, rule)
        chosen = name or (here or offering(offer))[0]
        if chosen not in self.systems:
            raise self._absent(chosen)
        return self._once(chosen, offer, lambda: open_system(chosen, offer, self.models, self._on()))

    def opened(self, offer: str, name: str | None = None) -> Any:
        """What the usual system, or `name`, offers (see `motionary.systems.registry`), opened once. Threads that share
        it take turns themselves."""
        return self._open(offer, name)

    def _on(self) -> str:
        """The device to run on."""
        from motionary.systems.io import choose_device

        return choose_device(self._device)

    def _judge(self, name: str | None = None) -> TextMotionJudge:
        return self._open(EMBED, name)

    def _once(self, name: str, what: str, build: Callable[[], T]) -> T:
        with self._lock:
            if (name, what) not in self._opened:
                self._opened[name, what] = build()
            return self._opened[name, what]

    def _absent(self, name: str) -> InputError:
        if find(name).package:  # it brings no stage of ours
            return InputError("system", name, "not part of these models")
        if self._manifest:
            rule = f"not part of this bundle; ask models that `dvc repro {name}` made, by --models or ${VARIABLE}"
            return InputError("system", name, rule)
        return InputError("system", name, f"not part of these models; run `dvc repro {name}`")


def _read(file: Path, writer: str) -> dict[str, Any]:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(file, error, f"must be JSON as {writer} writes it") from None
    return found if isinstance(found, dict) else {}
