"""``motionary search``: windows of the corpus, or moments of an indexed folder, for prompts."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.errors import InputError

_KEYS = ("id", "origin", "start", "end", "distance", "captions")


def _arguments(add: argparse.ArgumentParser) -> None:
    shared.add_prompts(add)
    add.add_argument("-k", type=shared.count, default=5, help="matches for each prompt (5)")
    told = "search this folder, which `motionary index` has read, and not the corpus"
    add.add_argument("--in", dest="archive", metavar="FOLDER", help=told)
    add.add_argument("--sound", action="store_true", help="with --in: leave out clips that look broken")
    shared.add_system(add)
    shared.add_seed(add)
    shared.add_models(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """A line for each match: its prompt where there are several, distance, name, seconds and first caption."""
    prompts = shared.read_prompts(options)
    if options.archive is not None:
        if options.system is not None:
            raise InputError("--system", options.system, "searches the corpus: not with --in")
        return _archive(options, prompts)
    dictionary = shared.open_models(options)
    found = dictionary.search(prompts, options.k, options.system)
    rows, lines = [], []
    for text, matches in zip(prompts, found, strict=True):
        read = shared.say_reading(dictionary, text)
        rows.append(
            {"text": text, **read, "matches": [{key: getattr(match, key) for key in _KEYS} for match in matches]}
        )
        for match in matches:
            said = match.captions[0] if match.captions else "-"
            seconds = f"{match.start:.2f}-{match.end:.2f} s"
            lines.append(f"{_asked(text, prompts)}{match.distance:.3f}\t{match.id}\t{seconds}\t{said}")
    _say_columns(options, "clip of the corpus")
    shared.show(options, rows, lines)


def _asked(text: str, prompts: Sequence[str]) -> str:
    """The first column, where there are several prompts."""
    return f"{text}\t" if len(prompts) > 1 else ""


def _say_columns(options: argparse.Namespace, name: str) -> None:
    """What the columns are, on standard error, so that standard output has matches alone."""
    if not options.json:
        distance = "distance of motion and text (from 0 up, nearest first; compare those of one prompt)"
        print(f"columns: {distance}, {name}, seconds of it, caption", file=sys.stderr)


def _archive(options: argparse.Namespace, prompts: list[str]) -> None:
    """A line for each moment: its prompt where there are several, distance, file, seconds and caption."""
    from motionary.archive import Archive

    archive = Archive(options.archive)
    dictionary = shared.open_models(options)
    found = archive.search(dictionary, prompts, options.k, options.sound)
    rows, lines = [], []
    for text, moments in zip(prompts, found, strict=True):
        read = shared.say_reading(dictionary, text)
        rows.append({"text": text, **read, "moments": [asdict(moment) for moment in moments]})
        for moment in moments:
            flags = f"\t({', '.join(moment.flags)})" if moment.flags else ""
            seconds = f"{moment.start:.2f}-{moment.end:.2f} s"
            said = f"{moment.distance:.3f}\t{moment.file}\t{seconds}\t{moment.caption or '-'}{flags}"
            lines.append(f"{_asked(text, prompts)}{said}")
    _say_columns(options, "file")
    shared.show(options, rows, lines)


COMMAND = Command(
    "search",
    "Find motions by text.",
    _arguments,
    _run,
    ('motionary search "a person sits down"', "motionary search jumps --in mocap -k 3"),
)
