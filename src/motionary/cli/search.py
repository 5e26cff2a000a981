"""``motionary search``: windows of the corpus for prompts."""

from __future__ import annotations

import argparse

from motionary.cli import options as shared
from motionary.cli.command import Command

_KEYS = ("id", "origin", "start", "end", "distance", "captions")


def _arguments(add: argparse.ArgumentParser) -> None:
    shared.add_prompts(add)
    add.add_argument("-k", type=shared.count, default=5, help="matches for each prompt (5)")
    shared.add_seed(add)
    shared.add_models(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """A line for each match: distance, name, seconds and first caption."""
    prompts = shared.read_prompts(options)
    found = shared.open_models(options).search(prompts, options.k)
    rows, lines = [], []
    for text, matches in zip(prompts, found, strict=True):
        rows.append({"text": text, "matches": [{key: getattr(match, key) for key in _KEYS} for match in matches]})
        for match in matches:
            said = match.captions[0] if match.captions else "-"
            lines.append(f"{match.distance:.3f}\t{match.id}\t{match.start:.2f}-{match.end:.2f} s\t{said}")
    shared.show(options, rows, lines)


COMMAND = Command(
    "search",
    "Find motions of the corpus by text.",
    _arguments,
    _run,
    ('motionary search "a person sits down"', "motionary search --file prompts.txt -k 3"),
)
