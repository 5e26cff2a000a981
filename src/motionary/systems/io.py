"""Models on disk: safetensors weights beside the config that rebuilds the model. Nothing is unpickled."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import nn

from motionary.corpus.context import Context
from motionary.errors import InputError
from motionary.files import atomic_file
from motionary.systems.registry import TELLS, System, find, known
from motionary.systems.renamed import with_new_names

WEIGHTS, CONFIG_FILE = "model.safetensors", "config.json"


def choose_device(device: str = "auto") -> str:
    """The device to compute on: `device`, or, for "auto", CUDA where there is one, else the CPU."""
    return ("cuda" if torch.cuda.is_available() else "cpu") if device == "auto" else device


def save_model(folder: str | Path, name: str, model: nn.Module, context: Context) -> None:
    """Write `model.safetensors` and `config.json` of the system `name` into `folder`, atomically.

    `model.config` must be the system's config dataclass; `context` says what the model knows of its data.
    """
    folder = Path(folder)
    record = {"system": name, "config": dataclasses.asdict(model.config), "context": context.to_json()}  # type: ignore[arg-type]
    # Tied weights share memory, which safetensors refuses: each name gets its own copy.
    tensors = {key: value.detach().cpu().contiguous().clone() for key, value in model.state_dict().items()}
    # Both are written before either takes its name, so that an error leaves the pair that was there.
    with atomic_file(folder / CONFIG_FILE) as config, atomic_file(folder / WEIGHTS) as weights:
        save_file(tensors, weights)
        config.write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")


def read_record(folder: str | Path) -> dict[str, Any]:
    """The `config.json` of a saved model: {"system", "config", "context"}."""
    path = Path(folder) / CONFIG_FILE
    if not path.is_file():
        # Members and settings of a system lie below its folder; another package's system has no stage of ours.
        stages = (part for part in reversed(path.parts) if part in known() and not known()[part].package)
        told = next((f"; run `dvc repro {stage}` first" for stage in stages), "")
        raise InputError(path, "missing", f"must be a trained model{told}")
    try:
        record = json.loads(path.read_text())
        config = with_new_names(record["system"], record["config"])
        return {"system": record["system"], "config": config, "context": record["context"]}
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(path, error, "must be JSON with system, config and context") from None


def load_model(folder: str | Path, device: str | torch.device = "cpu") -> nn.Module:
    """Rebuild the model that `save_model` wrote, in evaluation mode; its context is `model.context`."""
    folder = Path(folder)
    record = read_record(folder)
    try:
        system = find(record["system"])
    except InputError as error:
        raise InputError(folder / CONFIG_FILE, error.value, error.rule) from None
    try:
        config = system.load(system.config)(**record["config"])
    except TypeError as error:
        raise InputError(folder / CONFIG_FILE, error, "must hold the keys of this version's config") from None
    with torch.random.fork_rng(devices=[]):  # the random start is overwritten; do not disturb the caller's generator
        model = system.load(system.model)(config, Context.from_json(record["context"]))
    try:
        model.load_state_dict(load_file(folder / WEIGHTS))
    except (OSError, SafetensorError, RuntimeError) as error:
        raise InputError(folder / WEIGHTS, error, "must be the weights that belong to config.json") from None
    return model.to(device).eval()


class Trained:
    """A folder of trained systems, asked by role.

    Args:
        folder: that holds a folder for each system.
        device: where models are loaded.
        names: the system that fills a role, where it is not the one that the role is called after.
    """

    def __init__(self, folder: str | Path, device: str | torch.device = "cpu", names: Mapping[str, str] | None = None):
        self.folder, self.device, self.names = Path(folder), device, dict(names or {})

    def path(self, role: str) -> Path:
        """Folder of the system in a role."""
        return self.folder / self.names.get(role, role)

    def load(self, role: str) -> Any:
        """The model in a role, in evaluation mode."""
        return load_model(self.path(role), self.device)

    def config(self, role: str) -> dict[str, Any]:
        """The saved configuration of the model in a role."""
        return read_record(self.path(role))["config"]


def build_model(name: str, settings: Mapping[str, Any], context: Context, trained: Trained) -> Any:
    """A fresh model of a system, on what it needs of `trained`; `settings` are the keys of its section."""
    system = find(name)
    return system.function(system.build)(settings, context, trained)


def open_system(name: str, offer: str, models: str | Path, device: str | torch.device = "cpu") -> Any:
    """What the trained system `name` of the folder `models` offers, as its protocol.

    Raises:
        InputError: an unknown system, one that offers no such thing, or one that is not there.
    """
    system: System = find(name)
    if offer not in system.offers:
        raise InputError("system", name, f"does not {TELLS.get(offer, offer)}")
    return system.function(system.offers[offer])(Trained(models, device), name)


def model_hash(folder: str | Path) -> str:
    """Twelve hexadecimal digits that name a saved model's weights and config."""
    digest = hashlib.sha256()
    for file in (WEIGHTS, CONFIG_FILE):
        path = Path(folder) / file
        if not path.is_file():
            raise InputError(path, "missing", "must be a saved model")
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
