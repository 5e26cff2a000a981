"""The motion tokens of a corpus on disk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.files import save_array, written_by


class TokenStore:
    """The motion tokens of every window of a corpus, flat.

    Args:
        tokens: (N, ...) codes of all windows one after the other, integers or vectors.
        offsets: (clips + 1,) where each window's tokens start.
    """

    def __init__(self, tokens: np.ndarray, offsets: np.ndarray):
        if offsets[0] != 0 or offsets[-1] != len(tokens) or (np.diff(offsets) < 0).any():
            raise InputError("offsets", offsets[-1], f"must rise from 0 to the number of tokens, {len(tokens)}")
        self.tokens, self.offsets = tokens, offsets

    @classmethod
    def collect(cls, sequences: Sequence[np.ndarray]) -> TokenStore:
        """From one code sequence per corpus row."""
        offsets = np.concatenate([[0], np.cumsum([len(codes) for codes in sequences])]).astype(np.int64)
        flat = np.concatenate(sequences) if len(sequences) else np.zeros(0, np.int16)
        if flat.dtype.kind == "f":
            return cls(flat.astype(np.float32), offsets)
        small = not flat.size or flat.max() <= np.iinfo(np.int16).max
        return cls(flat.astype(np.int16 if small else np.int32), offsets)

    def save(self, folder: str | Path) -> None:
        """Write tokens.npy and offsets.npy."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        save_array(folder / "tokens.npy", self.tokens)
        save_array(folder / "offsets.npy", self.offsets)

    @classmethod
    def load(cls, folder: str | Path) -> TokenStore:
        """Read what `save` wrote."""
        folder = Path(folder)
        with written_by(folder.name, folder / "tokens.npy"):
            tokens = np.load(folder / "tokens.npy")
        with written_by(folder.name, folder / "offsets.npy"):
            offsets = np.load(folder / "offsets.npy")
            if offsets[0] != 0 or offsets[-1] != len(tokens) or (np.diff(offsets) < 0).any():
                raise InputError("offsets", f"0..{offsets[-1]}", f"must rise from 0 to {len(tokens)} tokens")
        return cls(tokens, offsets)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, i: int) -> np.ndarray:
        return self.tokens[self.offsets[i] : self.offsets[i + 1]]
