"""A bundle: of a trained run the systems that answer, in few megabytes, with a card that says what they are."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from motionary.corpus.store import Corpus
from motionary.dictionary import Dictionary, load
from motionary.dictionary.folder import BEST, MANIFEST
from motionary.dictionary.places import PACKAGED
from motionary.errors import KEPT, InputError
from motionary.files import atomic_folder
from motionary.pretrained.catalogue import catalogued, write_catalogue
from motionary.pretrained.fixed_sample import FixedSample
from motionary.systems.io import CATALOGUE, CONFIG_FILE, copy_compact, model_hash, roles
from motionary.systems.judges.corpus_search import Index, meanings_of
from motionary.systems.packing import BITS
from motionary.systems.registry import (
    EMBED,
    MOTION_TO_TEXT,
    SEARCH,
    TEXT_TO_LENGTH,
    TEXT_TO_MOTION,
    find,
    judges,
)  # fmt: skip
from motionary.systems.serving import served_by
from motionary.whole import check_output

MOST_BYTES = 25_000_000
CARD, SAMPLE = "CARD.md", "sample.npz"
ANSWERING = (TEXT_TO_MOTION, MOTION_TO_TEXT, TEXT_TO_LENGTH, EMBED, SEARCH)


def make_bundle(
    models: str | Path,
    out: str | Path = PACKAGED,
    *,
    generator: str | None = None,
    also: Iterable[str] = (),
    without: Iterable[str] = (),
    bits: int = 16,
    force: bool = False,
) -> dict[str, Any]:
    """Write the systems that answer, from a trained run, as a bundle that :func:`motionary.load` opens.

    Weights are float16 (or fewer `bits`) and become float32 when loaded. Of the corpus come the texts of the captioned
    training windows and where each lies in the judge's space, which is what the bundle's search looks over; no motions
    but a fixed sample of test windows, by which the packaged weights are scored.

    Args:
        models: the folder of trained systems; ``data/corpus`` and ``reports`` of the run lie beside it.
        out: the new folder; it appears whole or not at all.
        generator: the text-to-motion system that answers; None takes the usual one.
        also: names of further systems to take.
        without: names of systems that are left out, such as a second judge where both would be too large.
        bits: of a weight: 16, or 6 with a scale for each 64 of them.
        force: replace a bundle that is there.

    Returns:
        the manifest: "systems", "usual", "withheld", "corpus", "sample" (scores) and "bytes".

    Raises:
        InputError: a system that is not there, no corpus, a folder that is no bundle in the way, or more than 25 MB.
    """
    run = load(models)
    corpus = Corpus.open(check_output(run.models.parent, "data/corpus"))
    if bits not in BITS:
        raise InputError("bits", bits, f"must be one of {', '.join(map(str, BITS))}")
    left = set(without)
    able = {
        offer: [name for name in run.offering(offer) if name not in left and offer not in _withheld(name)]
        for offer in ANSWERING
    }
    usual = {offer: names[0] for offer, names in able.items() if names}
    usual |= {} if generator is None else {TEXT_TO_MOTION: _able(run, generator)}
    judging = [name for name in judges() if name in run.systems and name not in left]
    names = systems_of(run, (*usual.values(), *judging, *also))
    with atomic_folder(_free(Path(out), force)) as folder:
        manifest = {"bits": bits, **_fill(folder, run, names, corpus, bits)}
        (folder / BEST).write_text(json.dumps(usual, indent=1) + "\n", encoding="utf-8")
        manifest = {"systems": list(names), "usual": usual, **manifest, "corpus": corpus.hash}
        write_manifest(folder, manifest)
        sample = FixedSample.of(corpus)
        sample.save(folder / SAMPLE)
        manifest["sample"] = sample.scores(load(folder, "cpu"))
        write_manifest(folder, manifest)
        _write_card(folder, run, manifest, corpus)
        manifest["bytes"] = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
        if manifest["bytes"] > MOST_BYTES:
            rule = f"must have at most {MOST_BYTES / 1e6:g}; fewer bits (--bits) or systems (--without) help"
            raise InputError(out, f"{manifest['bytes'] / 1e6:.1f} MB", rule)
    return manifest


def systems_of(run: Dictionary, names: Iterable[str]) -> tuple[str, ...]:
    """These systems and all that they ask for when they answer, by the run's own configurations."""
    found = served_by(list(dict.fromkeys(names)), lambda name: roles(run.models / name))
    for name in found:
        if name not in run.systems:
            raise InputError("system", name, f"not part of {run.models}")
    return found


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """What the bundle is, as JSON."""
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")


def _free(out: Path, force: bool) -> Path:
    """The place of the bundle, where nothing is or `force` replaces a bundle, and never any other folder."""
    if out.is_dir() and any(out.iterdir()):
        if not (out / MANIFEST).is_file():
            raise InputError(out, "exists", "is no bundle; name another folder")
        if not force:
            raise InputError(out, "exists", KEPT)
    return out


def _able(run: Dictionary, generator: str) -> str:
    if generator not in run.offering(TEXT_TO_MOTION):
        rule = f"must be one of {', '.join(run.offering(TEXT_TO_MOTION)) or 'none'}"
        raise InputError("generator", generator, rule)
    return generator


def _fill(folder: Path, run: Dictionary, names: Iterable[str], corpus: Corpus, bits: int) -> dict[str, Any]:
    """Copies the systems; of one that looks things up in the corpus its index. Returns what those cannot do here."""
    for name in names:
        if find(name).model:
            for record in sorted((run.models / name).rglob(CONFIG_FILE)):
                copy_compact(record.parent, folder / record.parent.relative_to(run.models), bits)
        else:
            rows = catalogued(corpus)
            index = Index.load(run.models / name)
            judge = model_hash(folder / index.judge)
            Index(np.asarray(index.motions[rows], np.float16), judge, index.judge).save(folder / name)
            meanings_of(corpus).save(folder / name)
            write_catalogue(corpus, rows, folder / CATALOGUE)
    return {"withheld": {name: list(kept) for name in names if (kept := _withheld(name))}}


def _withheld(name: str) -> tuple[str, ...]:
    """What a system cannot do without the motions of the corpus: one without weights copies them, and one with weights
    keeps its own index of them (what it embeds is there all the same)."""
    return ((SEARCH,) if SEARCH in find(name).offers else ()) if find(name).model else (TEXT_TO_MOTION,)


def _write_card(folder: Path, run: Dictionary, manifest: Mapping[str, Any], corpus: Corpus) -> None:
    from motionary.pretrained.card import card

    text = card(folder, run.models.parent / "reports", manifest, corpus)
    (folder / CARD).write_text(text, encoding="utf-8")
