"""``motionary caption``: sentences for motion files."""

from __future__ import annotations

import argparse

from motionary.cli import options as shared
from motionary.cli.command import Command


def _arguments(add: argparse.ArgumentParser) -> None:
    shared.add_files(add)
    add.add_argument("-n", type=shared.count, default=1, help="captions of each, best first (1)")
    add.add_argument("--beams", type=shared.count, default=2, help="of the search (2)")
    add.add_argument("--temperature", type=float, help="draw captions at this temperature, not the likeliest")
    told = "choose those that agree best with this many draws (slower)"
    add.add_argument("--consensus", type=shared.count, default=0, help=told)
    add.add_argument("--source", help="in the words of this source of training captions, where they had several")
    shared.add_system(add)
    shared.add_reading(add)
    shared.add_cut(add)
    shared.add_seed(add)
    shared.add_models(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """A line for each caption, after its file's name where there are several files."""
    motions = shared.read_files(options)
    names = ("n", "beams", "system", "seed", "temperature", "consensus", "source")
    asked = {name: getattr(options, name) for name in names}
    dictionary = shared.open_models(options)
    found = shared.all_or_each(options, motions, lambda several: dictionary.caption(several, **asked))
    several = len(options.files) > 1
    pairs = [(file, found[file]) for file in options.files if file in found]
    lines = [f"{file}\t{text}" if several else text for file, texts in pairs for text in texts]
    shared.show(options, [{"file": file, "captions": texts} for file, texts in pairs], lines)


COMMAND = Command(
    "caption",
    "Describe motions in words.",
    _arguments,
    _run,
    ("motionary caption walk.bvh", "motionary caption a.bvh b.npz -n 3 --json"),
)
