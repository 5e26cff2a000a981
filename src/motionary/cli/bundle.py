"""``motionary bundle``: the systems that answer, of a trained run, in one small folder."""

from __future__ import annotations

import argparse
import json

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import add_force


def _arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("trained", metavar="MODELS", help="what `dvc repro` built, with its data/ and reports/ beside it")
    add.add_argument("--out", metavar="FOLDER", help="the new folder (that of the packaged models)")
    add.add_argument("--generator", metavar="NAME", help="the system that makes motions of text (the usual one)")
    add.add_argument("--also", nargs="+", default=[], metavar="NAME", help="further systems to take")
    add.add_argument("--without", nargs="+", default=[], metavar="NAME", help="systems to leave out, such as a judge")
    add.add_argument("--bits", type=int, default=16, help="of a weight: 16, or 6 where 25 MB are too few (16)")
    add_force(add, "a bundle that is there")
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """A bundle, its size and its card."""
    from motionary.dictionary.places import PACKAGED
    from motionary.pretrained.making import CARD, make_bundle

    out = options.out or PACKAGED
    chosen = {name: getattr(options, name) for name in ("generator", "also", "without", "bits", "force")}
    made = make_bundle(options.trained, out, **chosen)
    told = f"{out}: {', '.join(made['systems'])}; {made['bytes'] / 1e6:.1f} MB; {CARD} says what they are"
    print(json.dumps(made, indent=1) if options.json else told)


COMMAND = Command(
    "bundle",
    "Pack the systems that answer, of a trained run, into one small folder.",
    _arguments,
    _run,
    ("motionary bundle models --out out/bundle", "motionary bundle models --generator text2motion --force"),
)
