"""The packaged language model without transformers, whose import takes longer than all that a prompt asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

LAYERS, HEADS, EPSILON = 6, 12, 1e-12


class MiniLM:
    """A BERT encoder (Devlin et al. 2018: post-norm, exact GELU) with the weights of all-MiniLM-L6-v2.

    Args:
        folder: that holds model.safetensors and tokenizer.json.
        longest: tokens of a text that count.
    """

    def __init__(self, folder: Path, longest: int):
        from safetensors.torch import load_file
        from tokenizers import Tokenizer

        self.weights: Mapping[str, Tensor] = load_file(folder / "model.safetensors")
        self.tokenizer: Any = Tokenizer.from_file(str(folder / "tokenizer.json"))
        self.tokenizer.enable_truncation(longest)
        self.tokenizer.enable_padding()

    def to(self, device: str) -> MiniLM:
        """The model, on a device."""
        self.weights = {name: value.to(device) for name, value in self.weights.items()}
        return self

    def __call__(self, texts: Sequence[str]) -> tuple[Tensor, Tensor]:
        """States (B, N, 384) of the texts' tokens and the mask (B, N) of tokens that are there."""
        import torch

        found = self.tokenizer.encode_batch(list(texts))
        device = self.weights["embeddings.word_embeddings.weight"].device
        ids = torch.tensor([row.ids for row in found], device=device)
        mask = torch.tensor([row.attention_mask for row in found], device=device)
        states = self._embedded(ids)
        for layer in range(LAYERS):
            states = self._layer(f"encoder.layer.{layer}", states, mask[:, None, None].bool())
        return states, mask

    def _embedded(self, ids: Tensor) -> Tensor:
        words, places, kinds = (
            self.weights[f"embeddings.{name}_embeddings.weight"] for name in ("word", "position", "token_type")
        )
        return self._normalized("embeddings.LayerNorm", words[ids] + places[: ids.shape[1]] + kinds[0])

    def _layer(self, name: str, states: Tensor, mask: Tensor) -> Tensor:
        """states (B, N, D), mask (B, 1, 1, N) -> (B, N, D)."""
        from torch.nn.functional import gelu, scaled_dot_product_attention

        query, key, value = (
            self._linear(f"{name}.attention.self.{part}", states).unflatten(-1, (HEADS, -1)).transpose(1, 2)
            for part in ("query", "key", "value")
        )
        seen = scaled_dot_product_attention(query, key, value, mask).transpose(1, 2).flatten(-2)
        seen = self._linear(f"{name}.attention.output.dense", seen)
        states = self._normalized(f"{name}.attention.output.LayerNorm", states + seen)
        inner = gelu(self._linear(f"{name}.intermediate.dense", states))
        return self._normalized(f"{name}.output.LayerNorm", states + self._linear(f"{name}.output.dense", inner))

    def _linear(self, name: str, values: Tensor) -> Tensor:
        from torch.nn.functional import linear

        return linear(values, self.weights[f"{name}.weight"], self.weights[f"{name}.bias"])

    def _normalized(self, name: str, values: Tensor) -> Tensor:
        from torch.nn.functional import layer_norm

        return layer_norm(
            values, values.shape[-1:], self.weights[f"{name}.weight"], self.weights[f"{name}.bias"], EPSILON
        )


@lru_cache(maxsize=1)
def minilm(folder: Path, longest: int) -> MiniLM:
    """The model, kept for the process."""
    return MiniLM(folder, longest)
