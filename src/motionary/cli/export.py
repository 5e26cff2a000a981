"""``motionary export``: a folder of motion in the layout that other code reads."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import add_force

_SHOWN = 20  # problems; the rest is counted


def _arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("layout", choices=("humanml3d",), metavar="LAYOUT", help="humanml3d")
    add.add_argument("folder", metavar="FOLDER", help="motions, with or without clips.jsonl, or a released folder")
    add.add_argument("out", metavar="OUT", help="the new folder")
    kinds = ("clip", "subject", "combination")
    add.add_argument("--split", choices=kinds, default="clip", help="what no two splits share (clip)")
    shares = {"nargs": 3, "type": float, "metavar": ("TRAIN", "VAL", "TEST"), "default": (0.8, 0.05, 0.15)}
    add.add_argument("--ratios", help="shares of the splits (0.8 0.05 0.15)", **shares)
    mirror = {"action": argparse.BooleanOptionalAction, "default": True}
    add.add_argument("--mirror", help="add mirrored copies M<name>, as the release does (yes)", **mirror)
    add_force(add, "an existing folder")
    shared.add_seed(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """A released folder; what could not be used is said on standard error."""
    from motionary.corpus.exporting import export_humanml3d

    how = {name: getattr(options, name) for name in ("split", "ratios", "seed", "mirror", "force")}
    counts = export_humanml3d(options.folder, options.out, progress=sys.stderr.isatty(), **how)
    problems = counts.pop("problems")
    for problem in problems[:_SHOWN]:
        print(f"warning: {problem}", file=sys.stderr)
    if len(problems) > _SHOWN:
        print(f"warning: {len(problems) - _SHOWN} more problems", file=sys.stderr)
    row = {"folder": options.out, **counts, "mirrored": options.mirror, "problems": len(problems)}
    print(json.dumps(row, indent=1, ensure_ascii=False) if options.json else _line(row))


def _line(row: dict[str, Any]) -> str:
    """What was written, and how it was split."""
    copies = "mirrored copies among them" if row["mirrored"] else "without mirrored copies"
    how = "as the folder gives it" if row["split"] == "given" else f"by {row['split']}"
    shares = ", ".join(f"{split} {row[split]}" for split in ("train", "val", "test"))
    motions = f"{row['motions']} motions ({copies}) of {row['clips']} clips, {row['captions']} captions"
    return f"{row['folder']}: {motions}; split {how}: {shares}"


COMMAND = Command(
    "export",
    "Write a folder of motion in the layout of HumanML3D's release.",
    _arguments,
    _run,
    (
        "motionary export humanml3d recordings out/humanml3d",
        "motionary export humanml3d recordings out/humanml3d --split subject --no-mirror",
    ),
)
