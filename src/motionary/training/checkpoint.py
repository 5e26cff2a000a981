"""Checkpoints that resume exactly: tensors in safetensors, numbers in JSON, nothing unpickled.

Each carries a checksum, and the one before it is kept: what a disk has damaged is told from what was written.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from motionary.errors import InputError
from motionary.files import atomic_file


def save_checkpoint(
    path: Path, model: nn.Module, optimizer: torch.optim.Optimizer, extra: dict[str, Tensor], numbers: dict[str, Any]
) -> None:
    """Writes weights, optimizer moments, `extra` tensors and plain `numbers` to one file, atomically.

    The checkpoint that was there becomes :func:`earlier`.

    Raises:
        InputError: the disk is full or not writable.
    """
    tensors = {f"model.{name}": value for name, value in model.state_dict().items()}
    state = optimizer.state_dict()
    for index, moments in state["state"].items():
        tensors |= {f"optimizer.{index}.{key}": torch.as_tensor(value) for key, value in moments.items()}
    tensors |= {f"extra.{name}": value for name, value in extra.items()}
    contiguous = {name: value.detach().cpu().contiguous().clone() for name, value in tensors.items()}
    text = json.dumps(numbers)
    metadata = {"numbers": text, "checksum": _checksum(contiguous, text)}
    with atomic_file(path) as temporary:
        save_file(contiguous, temporary, metadata=metadata)
        if path.exists():  # killed before the new one has its name, a training goes on from this
            os.replace(path, earlier(path))


def earlier(path: Path) -> Path:
    """Where the checkpoint is kept that was written before the one at `path`."""
    return path.with_name(f"{path.stem}.earlier{path.suffix}")


def newest(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """Tensors and numbers of the newest checkpoint at `path` that is whole; None where there is none.

    Damaged ones are removed, with one line of warning each.
    """
    for place in (path, earlier(path)):
        if not place.exists():
            continue
        try:
            return _read(place)
        except InputError as error:
            place.unlink(missing_ok=True)  # or the next one that is written would keep it in the place of a whole one
            goes_on = "goes on from the one before" if earlier(path).exists() else "starts anew"
            print(f"warning: {error}; it is dropped, training {goes_on}", file=sys.stderr, flush=True)
    return None


def load_checkpoint(
    path: Path, model: nn.Module, optimizer: torch.optim.Optimizer
) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Restores what :func:`save_checkpoint` wrote; returns (extra tensors, numbers).

    Raises:
        InputError: the file is not what was written, by its checksum; nothing is restored then.
    """
    tensors, numbers = _read(path)
    return restore(tensors, model, optimizer), numbers


def restore(tensors: dict[str, Tensor], model: nn.Module, optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """Gives a model its weights and its optimizer the moments of a checkpoint's tensors; returns the extra ones."""
    model.load_state_dict(_under(tensors, "model."))
    state = optimizer.state_dict()
    moments: dict[int, dict[str, Tensor]] = {}
    for name, value in _under(tensors, "optimizer.").items():
        index, key = name.split(".", 1)
        moments.setdefault(int(index), {})[key] = value
    optimizer.load_state_dict({"state": moments, "param_groups": state["param_groups"]})
    return _under(tensors, "extra.")


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """All tensors and numbers of a checkpoint that is whole; else InputError."""
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if metadata["checksum"] != _checksum(tensors, metadata["numbers"]):
            raise InputError(path, "checksum differs", "damaged")
        return tensors, json.loads(metadata["numbers"])
    except (SafetensorError, OSError, KeyError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(path, error, "damaged") from None


def _checksum(tensors: Mapping[str, Tensor], numbers: str) -> str:
    """Of everything in a checkpoint: names, kinds, shapes and bytes of its tensors, and the text of its numbers."""
    digest = hashlib.blake2b(numbers.encode(), digest_size=16)
    for name in sorted(tensors):
        value = tensors[name]
        digest.update(f"{name} {value.dtype} {tuple(value.shape)};".encode())
        digest.update(value.reshape(-1).view(torch.uint8).numpy().data)
    return digest.hexdigest()


def _under(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
