"""Token states of the frozen language model, each text encoded once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motionary.language.frozen import STATE_DIM, token_states

LONGEST = 64  # tokens of a text that are kept


class TextStates:
    """The packaged model's token states of texts, remembered for the process: about 10 kB a caption.

    Args:
        device: where the model runs.
    """

    def __init__(self, device: str = "cpu"):
        self.device = device
        self._known: dict[str, np.ndarray] = {}

    def __call__(self, texts: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """States (B, N, d) float32 of texts, zero beyond each one's tokens, and the numbers of tokens (B,)."""
        missing = [text for text in dict.fromkeys(texts) if text not in self._known]
        if missing:
            states = (found[:LONGEST] for found in token_states(missing, device=self.device))
            self._known.update(zip(missing, states, strict=True))
        rows = [self._known[text] for text in texts]
        count = np.array([len(row) for row in rows], dtype=np.int64)
        padded = np.zeros((len(rows), int(count.max(initial=0)), STATE_DIM), np.float32)
        for place, row in enumerate(rows):
            padded[place, : len(row)] = row
        return padded, count
