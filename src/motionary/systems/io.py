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
from motionary.files import atomic_file, written_by
from motionary.systems.packing import compact, unpacked
from motionary.systems.protocols import DrawLengths
from motionary.systems.registry import TELLS, TEXT_TO_LENGTH, System, find, known
from motionary.systems.renamed import with_new_names

WEIGHTS, CONFIG_FILE = "model.safetensors", "config.json"
ROLES = "index.json"  # of a system without weights: whose space its index lies in
CATALOGUE = "corpus"  # folder beside the systems of a bundle: what was said of the corpus's windows, without motions


def choose_device(device: str = "auto") -> str:
    """The device to compute on: `device`, or, for "auto", CUDA where there is one, else the CPU.

    Raises:
        InputError: no such device on this machine.
    """
    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        torch.empty(1, device=device).cpu()
    except Exception:  # of any kind: a name that torch does not know, a build without it, a card too few
        raise InputError("device", device, "must be auto, cpu or a device that is here, as cuda:0") from None
    return device


def save_model(folder: str | Path, name: str, model: nn.Module, context: Context) -> None:
    """Write `model.safetensors` and `config.json` of the system `name` into `folder`, atomically.

    `model.config` must be the system's config dataclass; `context` says what the model knows of its data. The config
    holds checksums of the weights and of itself, by which what a disk has damaged is told.
    """
    folder = Path(folder)
    record = {"system": name, "config": dataclasses.asdict(model.config), "context": context.to_json()}  # type: ignore[arg-type]
    # Tied weights share memory, which safetensors refuses: each name gets its own copy.
    tensors = {key: value.detach().cpu().contiguous().clone() for key, value in model.state_dict().items()}
    _write(folder, record, tensors)


def copy_compact(folder: str | Path, target: str | Path, bits: int = 16) -> None:
    """A saved model once more, in fewer bytes; see :func:`motionary.systems.packing.compact`."""
    folder, record = Path(folder), read_record(folder)
    tensors = compact(load_file(folder / WEIGHTS), bits)
    _write(Path(target), {key: record[key] for key in ("system", "config", "context")}, tensors)


def _write(folder: Path, record: dict[str, Any], tensors: Mapping[str, torch.Tensor]) -> None:
    # Both are written before either takes its name, so that an error leaves the pair that was there.
    with atomic_file(folder / CONFIG_FILE) as config, atomic_file(folder / WEIGHTS) as weights:
        save_file(dict(tensors), weights)
        record["weights"] = _checksum(weights)
        record["checksum"] = _record_checksum(record)
        config.write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")


def read_record(folder: str | Path) -> dict[str, Any]:
    """The `config.json` of a saved model: {"system", "config", "context", "weights"}; the last is a checksum, or None
    where the model was saved without.

    Raises:
        InputError: missing or damaged: the file, what is wrong and the stage to run.
    """
    path = Path(folder) / CONFIG_FILE
    if not path.is_file():
        first = f"{again} first" if (again := _again(path)) else ""
        raise InputError(path, "missing", f"must be a trained model{first}")
    try:
        record = json.loads(path.read_text())
        if record.get("checksum") not in (None, _record_checksum(record)):
            raise ValueError("damaged, its checksum differs")
        config = with_new_names(record["system"], record["config"])
        found = {"system": record["system"], "config": config, "context": record["context"]}
        return {**found, "weights": record.get("weights")}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(path, error, f"must be JSON with system, config and context{_again(path)}") from None


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
        with torch.random.fork_rng(devices=[]):  # the random start is overwritten; the caller's generator stays
            model = system.load(system.model)(config, Context.from_json(record["context"]))
    except Exception as error:  # of any kind: a damaged record may claim anything
        rule = f"must hold the keys of this version's config and context{_again(folder / CONFIG_FILE)}"
        raise InputError(folder / CONFIG_FILE, error, rule) from None
    try:
        if record["weights"] not in (None, _checksum(folder / WEIGHTS)):
            raise OSError("damaged, its checksum differs")
        model.load_state_dict(unpacked(load_file(folder / WEIGHTS)))
    except (OSError, SafetensorError, RuntimeError) as error:
        rule = f"must be the weights that belong to config.json{_again(folder / WEIGHTS)}"
        raise InputError(folder / WEIGHTS, error, rule) from None
    return model.to(device).eval()


def roles(folder: str | Path) -> dict[str, Any]:
    """What a trained system says of the systems in its roles, for `registry.filled`: the keys of its config, or, where
    it has no weights, those of its index; none where nothing is trained."""
    folder = Path(folder)
    if (folder / CONFIG_FILE).is_file():
        return read_record(folder)["config"]
    if not (folder / ROLES).is_file():
        return {}
    with written_by(folder.name, folder / ROLES):
        return dict(json.loads((folder / ROLES).read_text()).get("roles", {}))


def _again(path: Path) -> str:
    """The command that makes a model again, as the end of a message; "" where no stage of this project does."""
    # Members and settings of a system lie below its folder; another package's system has no stage of ours.
    stages = (part for part in reversed(path.parts) if part in known() and not known()[part].package)
    return next((f"; run `dvc repro {stage}`" for stage in stages), "")


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def _record_checksum(record: Mapping[str, Any]) -> str:
    """Of everything in a config.json but this checksum."""
    values = {key: value for key, value in record.items() if key != "checksum"}
    return hashlib.blake2b(json.dumps(values, sort_keys=True).encode(), digest_size=16).hexdigest()


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


def lengths_of(trained: Trained) -> DrawLengths:
    """What draws the durations that are not given: the trained text2length."""
    name = trained.names.get("text2length", "text2length")
    lengths = open_system(name, TEXT_TO_LENGTH, trained.folder, trained.device)
    return lambda sentences, seeds, likeliest: lengths.sample(sentences, seeds, likeliest)


def model_hash(folder: str | Path) -> str:
    """Twelve hexadecimal digits that name a saved model's weights and config."""
    digest = hashlib.sha256()
    for file in (WEIGHTS, CONFIG_FILE):
        path = Path(folder) / file
        if not path.is_file():
            raise InputError(path, "missing", "must be a saved model")
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
