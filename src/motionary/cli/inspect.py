"""``motionary inspect``: what a motion file holds, and how it is read."""

from __future__ import annotations

import argparse

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import add_force
from motionary.errors import InputError


def _arguments(add: argparse.ArgumentParser) -> None:
    shared.add_files(add)
    shared.add_reading(add)
    add.add_argument("--out", metavar="PICTURE.png", help="draw eight moments and the way of each file")
    add_force(add, "an existing picture")
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """Rate, rig, axes, unit, sides, sizes and evidence of each file."""
    from motionary.formats.inspection import as_lines, inspect_motion

    if options.out is not None and not options.out.lower().endswith(".png"):
        raise InputError("--out", options.out, "a picture's name must end in .png")
    given = {"fps": options.source_fps, **shared.reading(options)}
    found = shared.each(options, {file: file for file in options.files}, lambda file: inspect_motion(file, **given))
    told = [row for row, _ in found.values()]
    if options.out is not None:
        from motionary.files import writable
        from motionary.formats.render.video import render_strip

        writable(options.out, options.force)
        titles = [f"{row['file']}: {row['stature'] or '?'} m, {row['seconds']:.1f} s" for row in told]
        render_strip([motion for _, motion in found.values()], options.out, titles, force=options.force)
    shared.show(options, told, [line for row in told for line in as_lines(row)])


COMMAND = Command(
    "inspect",
    "Say what a motion file holds and how it is read.",
    _arguments,
    _run,
    ("motionary inspect walk.bvh", "motionary inspect walk.npy --fps 30 --out walk.png"),
)
