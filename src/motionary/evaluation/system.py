"""One report for one system, whatever it offers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.evaluation.captioning import score_captioner
from motionary.evaluation.generation import score_generator
from motionary.evaluation.items import Items
from motionary.evaluation.jury import Jury
from motionary.evaluation.round_trip import score_reconstructor
from motionary.evaluation.sampled_positions import score_positions
from motionary.evaluation.scores import Protocol
from motionary.systems.codec import BatchedCodec
from motionary.systems.io import choose_device, open_system
from motionary.systems.protocols import CorpusSearch
from motionary.systems.registry import CODEC, EMBED, MOTION_TO_TEXT, SEARCH, TEXT_TO_MOTION, find, judges, offering

SCORED = (TEXT_TO_MOTION, MOTION_TO_TEXT, CODEC)


def score_system(
    name: str, models: Path, corpus: Corpus, protocol: Protocol, seed: int = 0, device: str = "auto"
) -> dict[str, Any]:
    """Scores what the system `name` of the folder `models` offers on the test split: motions of texts, texts of
    motions, motions passed through its codes. The folder also holds the system that searches, and the judges."""
    device, offers = choose_device(device), find(name).offers
    if not any(offer in offers for offer in SCORED):
        raise InputError("evaluation.system", name, f"offers nothing to score; that would be {', '.join(SCORED)}")
    search: CorpusSearch = open_system(offering(SEARCH)[0], SEARCH, models, device)
    items, jury = Items(corpus), _jury(models, search, protocol, device)
    hashes = {judge: jury.judges[judge].hash for judge in jury.judges}
    report: dict[str, Any] = {"system": name, "judge": hashes[jury.first], "judges": hashes}
    report |= {"corpus": corpus.hash, "items": len(items)}
    if TEXT_TO_MOTION in offers:
        generator = open_system(name, TEXT_TO_MOTION, models, device)
        nearest = search.index.judge, search.index.motions[corpus.rows("train")]
        report |= score_generator(generator, items, jury, seed, nearest)
        if protocol.position_samples and generator.takes_lengths:
            samples, most = protocol.position_samples, protocol.position_items
            size = protocol.batch_size
            report["joint_errors"] = score_positions(generator, items, samples, most, seed, size)
    if MOTION_TO_TEXT in offers:
        scored = score_captioner(open_system(name, MOTION_TO_TEXT, models, device), items, jury)
        report |= {f"caption_{key}" if key in report else key: value for key, value in scored.items()}
    if CODEC in offers:
        codec = BatchedCodec(open_system(name, CODEC, models), device, protocol.batch_size)
        scored = score_reconstructor(codec, items, jury)
        report |= scored | {"physics": report.get("physics", {}) | scored["physics"]}
    return report


def judges_of(models: Path) -> list[str]:
    """Names of the judges that lie in a folder of models, the one whose rows are the report's first."""
    return [name for name in judges() if (models / name).is_dir()]


def _jury(models: Path, search: CorpusSearch, protocol: Protocol, device: str) -> Jury:
    judges = {
        name: search.judge if name == search.index.judge else open_system(name, EMBED, models, device)
        for name in judges_of(models)
    }
    for judge in judges.values():
        judge.batch_size = protocol.batch_size
    return Jury(judges, protocol)
