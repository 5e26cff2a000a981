"""Training clips whose captions say nearly what a text says, for the generator to look at.

After ReMoDiffuse (Zhang et al., ICCV 2023), whose denoiser attends to retrieved motions; here both masked transformers
attend to their base tokens.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.corpus.store import Corpus
from motionary.corpus.token_store import TokenStore
from motionary.language import STATE_DIM, TextStates
from motionary.nn.padding import pad

POOL = 8  # the nearest clips, among which the examples of one motion are drawn
_CHUNK = 512  # captions that pass the language model together


class Examples(NamedTuple):
    """Base codes (B, k, S) of k clips for each text, of which `count` (B, k) are valid."""

    codes: Tensor
    count: Tensor

    def twice(self) -> Examples:
        """The batch twice over."""
        return Examples(*(torch.cat((x, x)) for x in self))


class ExampleBank(nn.Module):
    """The training clips' base tokens, and their captions as mean states of the frozen language model.

    It is empty until :meth:`take`, and then a part of the model's weights: whoever opens the model needs no corpus.

    Attributes:
        captions: (N, STATE_DIM) float16 of length 1, and `owner` (N,) the clip of each.
        codes: (C, S) int16 of each clip, of which `count` (C,) are valid.
    """

    captions: Tensor
    owner: Tensor
    codes: Tensor
    count: Tensor
    take_of: Tensor | None
    takes: Tensor | None

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("captions", torch.zeros(0, STATE_DIM, dtype=torch.float16))
        self.register_buffer("owner", torch.zeros(0, dtype=torch.int32))
        self.register_buffer("codes", torch.zeros(0, 0, dtype=torch.int16))
        self.register_buffer("count", torch.zeros(0, dtype=torch.int16))
        # The recording that each row of the corpus and each clip is cut from: only training must not look at its own.
        self.register_buffer("take_of", None, persistent=False)
        self.register_buffer("takes", None, persistent=False)

    def __len__(self) -> int:
        return len(self.count)

    def _load_from_state_dict(self, state_dict: dict[str, Any], prefix: str, *rest: Any) -> None:
        """A saved bank is as large as its corpus was."""
        for name in ("captions", "owner", "codes", "count"):
            if (saved := state_dict.get(prefix + name)) is not None:
                setattr(self, name, torch.empty_like(saved, device=self.owner.device))
        super()._load_from_state_dict(state_dict, prefix, *rest)

    def take(self, corpus: Corpus, tokens: TokenStore, states: TextStates) -> ExampleBank:
        """The captioned clips of the training split, mirrored ones too, with all their captions."""
        rows = corpus.rows("train", True)
        said = np.flatnonzero(np.isin(corpus.captions.clip, rows))
        means = [
            mean_state(*(torch.from_numpy(x) for x in states([str(text) for text in corpus.captions.text[part]])))
            for part in np.array_split(said, -(-len(said) // _CHUNK))
        ]
        self.captions = F.normalize(torch.cat(means), dim=-1).half().to(self.owner.device)
        self.owner = self._ids(np.searchsorted(rows, corpus.captions.clip[said]))
        codes, count = pad([tokens[row].reshape(len(tokens[row]), -1)[:, 0] for row in rows], np.int64)
        self.codes, self.count = codes.short().to(self.owner.device), count.short().to(self.owner.device)
        takes = np.unique(corpus.clips.origin, return_inverse=True)[1]
        self.take_of, self.takes = self._ids(takes), self._ids(takes[rows])
        return self

    def _ids(self, values: np.ndarray) -> Tensor:
        return torch.from_numpy(values.astype(np.int32)).to(self.owner.device)

    @torch.no_grad()
    def draw(self, wanted: int, states: Tensor, count: Tensor, noise: Tensor, rows: Tensor | None = None) -> Examples:
        """Examples of each text: `wanted` of the `POOL` clips with the nearest captions.

        Args:
            states: (B, N, STATE_DIM) of the texts, of which `count` (B,) are valid.
            noise: (B, POOL) uniform in [0, 1), which tells the ones that are drawn.
            rows: (B,) rows of the corpus that the texts belong to, whose own recordings are none; None where a text
                comes from elsewhere.
        """
        told = F.normalize(mean_state(states, count), dim=-1)
        near = told.to(self.captions.device) @ self.captions.float().mT  # (B, N)
        clips = torch.full((len(near), len(self)), -torch.inf, device=near.device)
        clips.scatter_reduce_(1, self.owner.long().expand(len(near), -1), near, "amax")
        if rows is not None and self.take_of is not None and self.takes is not None:
            clips.masked_fill_(self.take_of[rows][:, None] == self.takes, -torch.inf)
        likeness, pool = clips.topk(min(POOL, len(self)), 1)
        drawn = noise.to(pool.device)[:, : pool.shape[1]].argsort(1)[:, :wanted]
        chosen = pool.gather(1, drawn)
        found = self.count[chosen].long() * likeness.gather(1, drawn).isfinite()
        return Examples(self.codes[chosen].long()[..., : max(1, int(found.max()))], found)


def mean_state(states: Tensor, count: Tensor) -> Tensor:
    """(B, d): the mean of each text's states (B, N, d), of which `count` (B,) are valid and the others zero."""
    return states.sum(1) / count.clamp(min=1)[:, None]
