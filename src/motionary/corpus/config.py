"""The `data` section of the configuration, checked where it enters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from motionary.corpus.splits import KINDS, check_shares
from motionary.errors import InputError, is_real

COVERING, RELEASED = "covering", "released"
CUTS = (COVERING, RELEASED)
SOURCES = ("demo", "folder", "humanml3d")


@dataclass(frozen=True)
class DataConfig:
    """What corpus to build; conf/data/folder.yaml explains each setting.

    Attributes:
        name: of the corpus, for reports.
        source: "demo", "folder" or "humanml3d" (see :mod:`motionary.corpus.sources`).
        codec: a key of `motionary.features.CODECS`.
    """

    name: str = "demo"
    source: str = "demo"
    roots: tuple[str, ...] = ()
    fps: float = 20.0
    skeleton: str = "smpl22"
    codec: str = "humanml3d"
    min_seconds: float = 1.0
    max_seconds: float = 10.0
    cut: str = COVERING
    least_cover: float = 0.0
    source_weights: Mapping[str, float] = field(default_factory=dict)
    split: str = "clip"
    ratios: tuple[float, float, float] = (0.8, 0.05, 0.15)
    seed: int = 0
    mirror: bool = True
    strict: bool = False
    workers: int = 0
    min_count: int = 1
    clips: int = 2000

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> DataConfig:
        """From the configuration; InputError names `data.<key>` where a key is unknown or a value out of range."""
        known = {field.name for field in fields(cls)}
        for key in values:
            if key not in known:
                raise InputError(f"data.{key}", values[key], f"unknown key; known: {', '.join(sorted(known))}")
        values = dict(values)
        for key in ("roots", "ratios"):
            if key in values:
                value = values[key]
                if isinstance(value, str) or not isinstance(value, Sequence):
                    raise InputError(f"data.{key}", value, "must be a list")
                values[key] = tuple(value)
        return cls(**values)

    def __post_init__(self):
        self._text("name", "source", "skeleton", "codec", "split")
        self._choice("source", SOURCES)
        self._choice("split", KINDS)
        self._choice("cut", CUTS)
        self._whole("seed", 0, 2**31 - 1)
        self._whole("workers", 0, 1024)
        self._whole("min_count", 1, 10**6)
        self._whole("clips", 1, 10**7)
        self._real("fps", 1, 240)
        self._real("min_seconds", 0.5, 600)
        self._real("max_seconds", 0.5, 600)
        self._real("least_cover", 0, 1)
        if self.max_seconds < 2 * self.min_seconds:
            raise InputError("data.max_seconds", self.max_seconds, "must be at least twice min_seconds, to cut clips")
        for key in ("mirror", "strict"):
            if not isinstance(getattr(self, key), bool):
                raise InputError(f"data.{key}", getattr(self, key), "must be true or false")
        self._roots()
        check_shares("data.ratios", self.ratios)
        self._weights()

    def _roots(self):
        for root in self.roots:
            if not isinstance(root, str) or not root.strip():
                raise InputError("data.roots", root, "must be paths of folders")
        if len(set(self.roots)) < len(self.roots):
            raise InputError("data.roots", self.roots, "must name each folder once")
        if self.source == "demo" and self.roots:
            raise InputError("data.roots", self.roots, "the demo reads no folder; use data=folder for your own clips")
        if self.source != "demo" and not self.roots:
            raise InputError("data.roots", "[]", f"source {self.source} needs at least one folder")

    def _weights(self):
        if not isinstance(self.source_weights, Mapping):
            raise InputError("data.source_weights", self.source_weights, "must map caption sources to weights")
        for source, weight in self.source_weights.items():
            if not isinstance(source, str) or not is_real(weight) or not (weight == 0 or 1e-3 <= weight <= 1e3):
                raise InputError(f"data.source_weights.{source}", weight, "must be 0 or a number in 0.001..1000")

    def _text(self, *keys: str):
        for key in keys:
            value = getattr(self, key)
            if not isinstance(value, str) or not value.strip():
                raise InputError(f"data.{key}", value, "must be a non-empty string")

    def _choice(self, key: str, choices: Sequence[str]):
        if getattr(self, key) not in choices:
            raise InputError(f"data.{key}", getattr(self, key), f"must be one of {', '.join(choices)}")

    def _whole(self, key: str, low: int, high: int):
        value = getattr(self, key)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise InputError(f"data.{key}", value, f"must be a whole number in {low}..{high}")

    def _real(self, key: str, low: float, high: float):
        value = getattr(self, key)
        if not is_real(value) or not low <= value <= high:
            raise InputError(f"data.{key}", value, f"must be a number in {low:g}..{high:g}")
