"""``motionary view``: a page that plays motion files side by side."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import add_force
from motionary.errors import InputError


def _arguments(add: argparse.ArgumentParser) -> None:
    shared.add_files(add, ", shown side by side")
    add.add_argument("--out", metavar="PAGE.html", help="keep the page here (a temporary folder)")
    add_force(add, "an existing page")
    shared.add_reading(add)
    shared.add_cut(add)
    add.add_argument("--no-open", action="store_true", help="write the page, open no browser")


def _run(options: argparse.Namespace) -> None:
    """Writes the page, names it, and opens it unless told not to."""
    from motionary.formats.render.page import write_page

    motions = shared.read_files(options)
    target = options.out
    if target is None:
        target = Path(tempfile.mkdtemp(prefix="motionary-")) / "motions.html"
    elif Path(target).suffix.lower() != ".html":
        raise InputError("--out", target, "a player's name must end in .html")
    shown = [file for file in options.files if file in motions]
    titles = [Path(file).stem for file in shown]
    path = write_page([motions[file] for file in shown], target, titles, force=options.force)
    print(path)
    if not options.no_open:
        import webbrowser

        webbrowser.open(path.resolve().as_uri())


COMMAND = Command(
    "view",
    "Play motions in a browser.",
    _arguments,
    _run,
    ("motionary view motion.npz", "motionary view a.bvh b.bvh --out pair.html --no-open"),
)
