"""The card of a bundle: what it is made of, under which terms, what it scores, where it fails, what it is not for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from safetensors.torch import load_file

from motionary.corpus.store import Corpus
from motionary.pretrained.fixed_sample import judges_rows
from motionary.report.corpus_table import corpus_tables
from motionary.report.results import Results, at
from motionary.report.summary import main_tables
from motionary.report.table import Table, percent, show
from motionary.systems.io import WEIGHTS
from motionary.systems.packing import unpacked
from motionary.systems.registry import MOTION_TO_TEXT, SEARCH, TELLS, TEXT_TO_MOTION, find, known

# Of the corpora that the project knows: what stands in a caption's `source`, or in the corpus's name.
TERMS = {
    "grammar": "made by the project itself (MIT)",
    "humanml3d": "sentences by people, of HumanML3D (MIT)",
    "cmu-index": "phrases of the CMU motion capture database's own index (free for all uses)",
    "cmu": "the CMU motion capture database (free for all uses, products included; not to be resold as data)",
    "kit-ml": "sentences by people, of KIT-ML (for research only: these weights must not be passed on)",
    "label-template": "sentences made of labels of the Bandai-Namco dataset (CC BY-NC 4.0: no commercial use)",
    "class-template": "sentences made of class names",
}
CMU = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with funding from NSF "
    "EIA-0196217."
)
FAILURES = (
    "Prompts are read as at most 20 words of the training captions. Other words are replaced by the nearest known "
    "ones; `read as` says by which, and how far the prompt is from anything that was learned.",
    "Hands, fingers and faces do not move, objects and other people are not there, the ground is flat.",
    "All motions have one body. Its bones keep their length only after the rotations are fitted, which writing does.",
    "Motions last ten seconds at most; counts (\"three times\"), sides and fine timing are often wrong.",
    "Who captioned the training motions wrote typos and wrong sides too, and mostly about everyday and dance moves.",
)  # fmt: skip
NOT_FOR = (
    "telling who a person is, watching people, or judging their health, ability, mood or fitness for anything",
    "steering machines, vehicles or medical devices without a safeguard that does not rest on it",
    "comparison with published HumanML3D results: captions may come from that dataset's validation and test splits",
    "passing on as motion data: the sample of test motions is there to check the scores",
)


def card(folder: Path, reports: Path, manifest: Mapping[str, Any], corpus: Corpus) -> str:
    """The card, as Markdown.

    Args:
        folder: of the bundle.
        reports: of the run; whatever is missing there is left out.
        manifest: of the bundle, with the scores of the fixed sample.
        corpus: that everything was trained on.
    """
    results = Results.read(reports) if reports.is_dir() else Results()
    blocks = [
        f"# Motions and captions of the corpus `{at(results.stages, 'preprocess', 'name') or 'unnamed'}`",
        "Text to motion, motion to text and search, trained by motionary's own pipeline. `motionary.load()` opens it.",
        _systems(folder, manifest).markdown(),
        f"The corpus is {manifest['corpus'][:12]} by its content's hash.",
        _data(results, corpus),
        "## Scores",
        _scores(results, manifest),
        _sample(manifest).markdown(),
        "## Known failures",
        _listed((*FAILURES, *_measured(results, manifest))),
        "## Not to be used for",
        _listed(NOT_FOR),
    ]
    return "\n\n".join(block.strip() for block in blocks if block) + "\n"


def _systems(folder: Path, manifest: Mapping[str, Any]) -> Table:
    usual = {name: offer for offer, name in reversed(manifest["usual"].items())}
    rows = []
    for name in manifest["systems"]:
        withheld = manifest["withheld"].get(name, ())
        can = ", ".join(TELLS[offer] for offer in find(name).offers if offer not in withheld)
        size = sum(file.stat().st_size for file in (folder / name).rglob("*") if file.is_file())
        rows.append([name, can, "yes" if name in usual else "", f"{size / 1e6:.2f}", _sizes(folder / name)])
    told = "float16" if manifest["bits"] == 16 else f"{manifest['bits']}-bit integers with float16 scales"
    columns = ["system", "can", "answers when none is named", "MB", "weights"]
    return Table("Systems", columns, rows, f"{told} on the disk, float32 in use; nothing is unpickled.")


def _sizes(folder: Path) -> str:
    """How many numbers the weights of a system are."""
    tensors = (unpacked(load_file(file)) for file in folder.rglob(WEIGHTS))
    count = sum(values.numel() for found in tensors for values in found.values())
    return f"{count:,}" if count else "-"


def _data(results: Results, corpus: Corpus) -> str:
    """What was learned from, whose it is, and what is owed to whom."""
    own = ~corpus.added[corpus.captions.clip]
    sources = Counter(map(str, corpus.captions.source[own]))
    name = str(at(results.stages, "preprocess", "name") or "")
    rows = [
        [source or "-", f"{count:,}", TERMS.get(source, "as its owner says")]
        for source, count in sorted(sources.items())
    ]
    if name in TERMS and name not in sources:
        rows.append([name, "motions", TERMS[name]])
    blocks = ["## Data", Table("Sources", ["source", "captions", "terms"], rows).markdown()]
    if preprocess := results.stages.get("preprocess"):
        blocks += [table.markdown() for table in corpus_tables(preprocess)[:2]]
    if "cmu" in name or any("cmu" in source for source in sources):
        blocks.append(CMU)
    return "\n\n".join(block.strip() for block in blocks)


def _scores(results: Results, manifest: Mapping[str, Any]) -> str:
    """The run's own evaluation of these systems, on its whole test split, before the weights were halved."""
    copying = {name for name, system in known().items() if SEARCH in system.offers}
    kept = {n: report for n, report in results.systems.items() if n in {*manifest["systems"], *copying}}
    tables = main_tables(replace(results, systems=kept, stages={}))
    if not tables:
        return "The run's reports were not at hand."
    told = (
        "The whole test split, as the run's reports have it (weights in float32; the packaged ones are these, "
        "rounded). Retrieval copies training motions, for comparison."
    )
    return "\n\n".join([told, *(table.markdown().strip() for table in tables)])


def _sample(manifest: Mapping[str, Any]) -> Table:
    """Scores of the packaged weights themselves."""
    rows = [
        [judge, kind, *(show(value, 3) for value in values)] for judge, kind, values in judges_rows(manifest["sample"])
    ]
    note = "The packaged weights on the sample of test windows that lies beside this card, ranked among each other."
    return Table("Fixed sample", ["by", "", "R@1", "R@2", "R@3"], rows, note)


def _measured(results: Results, manifest: Mapping[str, Any]) -> list[str]:
    """Failures that the run has measured of the systems that answer."""
    makes = results.systems.get(manifest["usual"].get(TEXT_TO_MOTION, ""), {})
    says = results.systems.get(manifest["usual"].get(MOTION_TO_TEXT, ""), {})
    found = []
    made, real = (at(makes, "physics", kind, "foot_skating") for kind in ("generated", "real"))
    if made is not None:
        found.append(f"Feet slide: {show(made)} m/s before they are planted, where real ones have {show(real)}.")
    prompts = at(makes, "oracle", "prompts", "each") or {}
    if worst := sorted(prompts, key=lambda text: prompts[text])[:3]:
        told = ", ".join(f'"{text}" ({percent(prompts[text])})' for text in worst)
        found.append(f"Prompts that a geometric reading confirms least often: {told}.")
    bleu = at(says, "language", "all", "raw", "bleu4")
    if bleu is not None:
        found.append(f"Captions share little with any one human sentence: raw BLEU-4 {show(bleu)}.")
    return found


def _listed(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)
