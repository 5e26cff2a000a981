"""``motionary fetch``: public motion with sentences, obtained and converted."""

from __future__ import annotations

import argparse
import json
import sys

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.errors import InputError

_SHOWN = 20  # problems; the rest is counted


def _arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("corpus", choices=("cmu",), metavar="CORPUS", help="cmu: CMU's takes with HumanML3D's sentences")
    add.add_argument("--out", required=True, metavar="DIR", help="the folder; the same again goes on where it stopped")
    add.add_argument("--takes", metavar="NAMES", help="only these, such as 01_01,02_03 (all)")
    told = "downloads.jsonl of another run: files must have its SHA-256"
    add.add_argument("--manifest", metavar="FILE", help=told)
    mirror = {"action": "append", "default": [], "metavar": "PLACE=URL"}
    add.add_argument("--mirror", help="another URL of cmu, humanml3d or index; may be repeated", **mirror)
    add.add_argument("--jobs", type=shared.count, default=4, help="downloads at once (4)")
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """A folder with clips.jsonl; what could not be had is said on standard error, and then the exit code is 2."""
    from motionary.corpus.cmu import fetch_cmu

    places = dict(_place(text) for text in options.mirror)
    takes = options.takes.split(",") if options.takes else None
    bar = sys.stderr.isatty()
    found = fetch_cmu(options.out, takes, options.manifest, places, options.jobs, progress=bar)
    problems = found.pop("problems")
    for problem in problems[:_SHOWN]:
        print(f"warning: {problem}", file=sys.stderr)
    if len(problems) > _SHOWN:
        print(f"warning: {len(problems) - _SHOWN} more problems", file=sys.stderr)
    options.failed = bool(problems)
    row = {"folder": options.out, **found, "problems": len(problems)}
    line = f"{options.out}: {found['takes']} takes, {found['sentences']} sentences"
    print(json.dumps(row, indent=1, ensure_ascii=False) if options.json else line)


def _place(text: str) -> tuple[str, str]:
    name, equals, url = text.partition("=")
    if not equals:
        raise InputError("--mirror", text, "must be PLACE=URL")
    return name, url


COMMAND = Command(
    "fetch",
    "Obtain public motion with sentences as a folder to train on.",
    _arguments,
    _run,
    ("motionary fetch cmu --out ../shared/data/cmu", "motionary fetch cmu --out out/cmu --takes 01_01,02_03"),
)
