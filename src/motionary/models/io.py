"""Models on disk: safetensors weights beside the config that rebuilds the model. Nothing is unpickled."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import shutil
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import nn

from motionary.errors import InputError

WEIGHTS, CONFIG_FILE = "model.safetensors", "config.json"


def choose_device(device: str = "auto") -> str:
    """The device to compute on: `device`, or, for "auto", CUDA where there is one, else the CPU."""
    return ("cuda" if torch.cuda.is_available() else "cpu") if device == "auto" else device


def save_model(folder: str | Path, name: str, model: nn.Module, context: Any) -> None:
    """Write `model.safetensors` and `config.json` of the system `name` into `folder`, atomically.

    `model.config` must be the system's config dataclass; `context` says what the model knows of its data.
    """
    folder = Path(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    record = {"system": name, "config": dataclasses.asdict(model.config), "context": context.to_json()}  # type: ignore[arg-type]
    temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        # Tied weights share memory, which safetensors refuses: each name gets its own copy.
        tensors = {key: value.detach().cpu().contiguous().clone() for key, value in model.state_dict().items()}
        save_file(tensors, temporary / WEIGHTS)
        (temporary / CONFIG_FILE).write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")
        os.chmod(temporary, 0o755)
        folder.mkdir(exist_ok=True)
        for file in (WEIGHTS, CONFIG_FILE):
            os.replace(temporary / file, folder / file)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def read_record(folder: str | Path) -> dict[str, Any]:
    """The `config.json` of a saved model: {"system", "config", "context"}."""
    path = Path(folder) / CONFIG_FILE
    if not path.is_file():
        raise InputError(path, "missing", f"must be a trained model; run `dvc repro {Path(folder).name}` first")
    try:
        record = json.loads(path.read_text())
        return {key: record[key] for key in ("system", "config", "context")}
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(path, error, "must be JSON with system, config and context") from None


def load_model(folder: str | Path, device: str | torch.device = "cpu") -> nn.Module:
    """Rebuild the model that `save_model` wrote, in evaluation mode; its context is `model.context`."""
    from motionary.corpus.context import Context

    folder = Path(folder)
    record = read_record(folder)
    try:
        module = import_module(f"motionary.models.{record['system']}")
    except ModuleNotFoundError:
        raise InputError(folder / CONFIG_FILE, record["system"], "must name a system of motionary.models") from None
    try:
        config = module.CONFIG(**record["config"])
    except TypeError as error:
        raise InputError(folder / CONFIG_FILE, error, "must hold the keys of this version's config") from None
    with torch.random.fork_rng(devices=[]):  # the random start is overwritten; do not disturb the caller's generator
        model = module.MODEL(config, Context.from_json(record["context"]))
    try:
        model.load_state_dict(load_file(folder / WEIGHTS))
    except (OSError, SafetensorError, RuntimeError) as error:
        raise InputError(folder / WEIGHTS, error, "must be the weights that belong to config.json") from None
    return model.to(device).eval()


def load_sibling(folder: str | Path, name: str, device: str | torch.device = "cpu") -> nn.Module:
    """The model of the upstream system `name`, from `folder/name`."""
    return load_model(Path(folder) / name, device)


def model_hash(folder: str | Path) -> str:
    """Twelve hexadecimal digits that name a saved model's weights and config."""
    digest = hashlib.sha256()
    for file in (WEIGHTS, CONFIG_FILE):
        path = Path(folder) / file
        if not path.is_file():
            raise InputError(path, "missing", "must be a saved model")
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
