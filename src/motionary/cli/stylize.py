"""``motionary stylize``: motion files in another style."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import Outputs, add_outputs, slug, variants


def _arguments(add: argparse.ArgumentParser) -> None:
    shared.add_files(add, ", of any length", rate="--source-fps")
    add.add_argument("--style", metavar="NAME", help="of the training clips; with neither style nor reference: random")
    add.add_argument("--reference", metavar="FILE", help="a motion in the wanted style, of a second or two at least")
    told = "0: as the model rebuilds it, 1: the whole style (1)"
    add.add_argument("--strength", type=shared.strength, default=1.0, help=told)
    add.add_argument("-n", type=shared.count, default=1, help="variants of each; a reference has only one (1)")
    keep = {"action": argparse.BooleanOptionalAction, "default": True}
    add.add_argument("--keep-rig", help="results on the rig and at the rate of each file (yes, unless --onto)", **keep)
    shared.add_feet(add)
    add_outputs(add)
    shared.add_reading(add)
    shared.add_cut(add)
    shared.add_seed(add)
    shared.add_models(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """Motion files in another style, in every format asked for."""
    from motionary.formats import read_motion

    names = _names(options)
    outputs = Outputs(options)
    motions, reference = shared.read_files(options), None
    if options.reference is not None:
        reference = read_motion(options.reference, fps=options.source_fps, **shared.reading(options))
    dictionary = shared.open_models(options)
    shared.check_style(dictionary, options)
    outputs.claim(name for row in names for name in row)
    keep = options.keep_rig and options.onto is None  # onto a third rig by way of the file's own would cost accuracy
    asked = (options.style, reference, options.n, options.seed, options.strength, keep, options.feet)
    found = shared.all_or_each(options, motions, lambda several: dictionary.stylize(several, *asked))
    rows: list[dict[str, Any]] = []
    for path, row in zip(options.files, names, strict=True):
        for variant, (name, motion) in enumerate(zip(row, found.get(path, []), strict=False)):
            what = {"file": path, "style": options.style, "reference": options.reference, "seed": options.seed}
            seconds = round(motion.duration, 3)
            rows.append(what | {"variant": variant, "seconds": seconds, "files": outputs.write(motion, name)})
    shared.show(options, rows, [file for row in rows for file in row["files"]])


def _names(options: argparse.Namespace) -> list[list[str]]:
    """Names of the results of each file, without extension: the file's own, numbered where two are alike, and the
    style's."""
    label = options.style or (Path(options.reference).stem if options.reference else "restyled")
    told = slug(label, "restyled")
    stems = [Path(path).stem for path in options.files]
    if len(set(stems)) < len(stems):
        stems = [f"{i}-{stem}" for i, stem in enumerate(stems)]
    return [variants(f"{stem}-{told}", options.n) for stem in stems]


COMMAND = Command(
    "stylize",
    "Give motions another style.",
    _arguments,
    _run,
    (
        "motionary stylize walk.bvh --style old --out out --format bvh,glb",
        "motionary stylize walk.bvh --reference limp.bvh",
        "motionary stylize walk.bvh -n 3 --seed 1",
    ),
)
