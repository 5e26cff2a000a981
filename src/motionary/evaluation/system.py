"""One report for one system, whatever it offers."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.evaluation.captioning import score_captioner
from motionary.evaluation.generation import score_generator
from motionary.evaluation.items import Items
from motionary.evaluation.positions import Reconstructor
from motionary.evaluation.reconstruction import score_reconstructor
from motionary.evaluation.scores import Protocol
from motionary.models.io import choose_device, load_model
from motionary.models.judge import Judge
from motionary.models.retrieval import Index


def score_system(
    name: str, models: Path, corpus: Corpus, protocol: Protocol, seed: int = 0, device: str = "auto"
) -> dict[str, Any]:
    """Scores the system `name` of the folder `models` on the test split.

    A system's module offers ``open_generator(models, device)`` (text to motion), ``open_captioner(models, device)``
    (motion to text), or a ``MODEL`` with ``encode`` and ``decode``; each that is there is scored.
    """
    device = choose_device(device)
    try:
        module = import_module(f"motionary.models.{name}")
    except ModuleNotFoundError as error:
        raise InputError("evaluation.system", name, "must be a system in motionary.models") from error
    judge, items = Judge(models, device, protocol.batch_size), Items(corpus)
    report: dict[str, Any] = {"system": name, "evaluator": judge.hash, "corpus": corpus.hash, "items": len(items)}
    if hasattr(module, "open_generator"):
        index = Index.load(models / "retrieval")
        nearest = index.motions[corpus.rows("train")]
        report |= score_generator(module.open_generator(models, device), items, judge, protocol, seed, nearest)
    if hasattr(module, "open_captioner"):
        scored = score_captioner(module.open_captioner(models, device), items, judge, protocol)
        report |= {f"caption_{key}" if key in report else key: value for key, value in scored.items()}
    model = getattr(module, "MODEL", None)
    if hasattr(model, "encode") and hasattr(model, "decode"):
        reconstructor = Reconstructor(load_model(models / name), device, protocol.batch_size)
        report |= score_reconstructor(reconstructor, items, judge, protocol)
    if len(report) == 4:
        raise InputError("evaluation.system", name, "offers no generator, captioner or encoder to score")
    return report
