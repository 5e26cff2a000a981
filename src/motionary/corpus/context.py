"""What a model must know of the data it was trained on; saved inside every model's config."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.features import UNIT, Codec, Columns, codec, columns, other_columns
from motionary.language import Vocabulary
from motionary.motion import Skeleton


@dataclass(frozen=True, eq=False)
class Context:
    """The facts of a corpus that a trained model carries with it.

    Attributes:
        skeleton: joints of every motion.
        fps: frames per second of features and of decoded motion.
        codec: name of the feature codec.
        unit: frames per motion token; lengths are multiples of it. Always `motionary.features.UNIT`.
        mean: (D,) float32, mean of the raw features over the training split.
        std: (D,) float32, deviation of the raw features, averaged within each feature group; root
            features and foot contacts divided by 5 (the papers' "scaled by 5").
        vocabulary: words of the training captions.
        max_frames: longest window in feature frames.
        styles, actions: label names; the label ids of a batch are positions in these tuples.
    """

    skeleton: Skeleton
    fps: float
    codec: str
    unit: int
    mean: np.ndarray
    std: np.ndarray
    vocabulary: Vocabulary
    max_frames: int
    styles: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()

    def __post_init__(self):
        for name in ("mean", "std"):
            value = np.asarray(getattr(self, name), dtype=np.float32)
            if value.ndim != 1 or not np.isfinite(value).all():
                raise InputError(f"context.{name}", value.shape, "must be a finite vector, one number per feature")
            object.__setattr__(self, name, value)
        if self.unit != UNIT:
            raise InputError("context.unit", self.unit, f"must be {UNIT}: networks halve time twice")
        if self.mean.shape != self.std.shape or (self.std <= 0).any():
            raise InputError("context.std", self.std.shape, "must be positive and as long as the mean")

    @property
    def dim(self) -> int:
        """Features per frame."""
        return len(self.mean)

    @property
    def max_tokens(self) -> int:
        """Most motion tokens that a window has."""
        return self.max_frames // self.unit

    @cached_property
    def slices(self) -> Mapping[str, slice]:
        """Columns of each group of the codec's features."""
        return self.make_codec().slices

    def columns(self, *names: str) -> Columns:
        """Columns of groups of features, one group after the other; InputError for one that the codec lacks."""
        return columns(self.slices, names)

    def other_columns(self, *names: str) -> Columns:
        """All columns but those of the named groups."""
        return other_columns(self.slices, names)

    def seen_columns(self, hide_contacts: bool) -> Columns:
        """What an encoder reads: all columns, or all but the foot contacts, which its decoder then has to predict."""
        return self.other_columns("contacts") if hide_contacts else self.other_columns()

    def make_codec(self) -> Codec:
        """The codec that encodes and decodes this corpus's features."""
        return codec(self.codec, self.skeleton)

    def to_json(self) -> dict[str, Any]:
        """Plain values; float32 survives the round trip exactly."""
        return {
            "skeleton": self.skeleton.to_json(),
            "fps": float(self.fps),
            "codec": self.codec,
            "unit": int(self.unit),
            "max_frames": int(self.max_frames),
            "mean": self.mean.tolist(),
            "std": self.std.tolist(),
            "vocabulary": self.vocabulary.to_json(),
            "styles": list(self.styles),
            "actions": list(self.actions),
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Context:
        """Read what `to_json` wrote; a missing key raises InputError."""
        try:
            return cls(
                skeleton=Skeleton.from_json(values["skeleton"]),
                fps=float(values["fps"]),
                codec=str(values["codec"]),
                unit=int(values["unit"]),
                mean=np.asarray(values["mean"], dtype=np.float32),
                std=np.asarray(values["std"], dtype=np.float32),
                vocabulary=Vocabulary.from_json(values["vocabulary"]),
                max_frames=int(values["max_frames"]),
                styles=tuple(values["styles"]),
                actions=tuple(values["actions"]),
            )
        except KeyError as error:
            raise InputError("context", error.args[0], "key is missing; was this file written by preprocess?") from None

    def save(self, path: str | Path) -> None:
        """Writes the context as JSON."""
        Path(path).write_text(json.dumps(self.to_json()) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Context:
        """Reads what :meth:`save` wrote; anything else is an InputError."""
        try:
            return cls.from_json(json.loads(Path(path).read_text(encoding="utf-8")))
        except (OSError, json.JSONDecodeError) as error:
            raise InputError(path, error, "must be a context.json written by preprocess") from None
