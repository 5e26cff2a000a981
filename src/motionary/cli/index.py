"""``motionary index``: captions, flags, near-duplicates and an index of a folder of motion."""

from __future__ import annotations

import argparse
import json
import sys

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import add_force

_SHOWN = 20  # problems; the rest is counted


def _arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("folder", metavar="FOLDER", help="motions, with or without clips.jsonl")
    add.add_argument("--out", metavar="FOLDER", help="where the results go (the folder itself)")
    add.add_argument("--workers", type=shared.count, default=0, help="processes (one for each core)")
    add_force(add, "captions.jsonl, flags.jsonl and duplicates.jsonl that are not as an index wrote them")
    shared.add_models(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """Counts of what was found; what could not be listed is said on standard error."""
    from motionary.archive import index_folder

    found = index_folder(
        options.folder,
        options.models,
        options.out,
        options.device,
        options.workers,
        progress=sys.stderr.isatty(),
        force=options.force,
    )
    problems = found.pop("problems")
    for problem in problems[:_SHOWN]:
        print(f"warning: {problem}", file=sys.stderr)
    if len(problems) > _SHOWN:
        print(f"warning: {len(problems) - _SHOWN} more problems", file=sys.stderr)
    if options.json:
        print(json.dumps(found, indent=1))
        return
    flags = ", ".join(f"{flag} {count}" for flag, count in found["flagged"].items())
    print(f"{found['clips']} clips, {found['hours']:.2f} hours, {found['windows']} windows")
    print(f"{found['broken']} clips look broken{f': {flags}' if flags else ''}")
    print(f"{found['duplicates']} pairs of windows are nearly alike")


COMMAND = Command(
    "index",
    "Caption, grade and index a folder of motion.",
    _arguments,
    _run,
    ("motionary index mocap", "motionary index mocap --out results --workers 8"),
)
