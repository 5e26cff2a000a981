"""``motionary edit``: parts of motion files made anew, motions gone on with, gaps filled."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import Outputs, add_outputs
from motionary.errors import InputError

if TYPE_CHECKING:
    from motionary.dictionary import Dictionary
    from motionary.motion import Motion


def _arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("file", metavar="FILE", help=shared.READ)
    add.add_argument("text", nargs="?", metavar="TEXT", help="what happens in the part that is made")
    add.add_argument("--start", type=float, help="seconds from which it is made anew")
    add.add_argument("--end", type=float, help="seconds up to which")
    add.add_argument("--extend", type=float, metavar="SECONDS", help="go on for so long; without TEXT as it went")
    add.add_argument("--between", metavar="FILE", help="lead from the end of the one file to the begin of this one")
    add.add_argument("--seconds", type=float, help="for --between (1)")
    add.add_argument("--source-fps", type=float, help="rate of the files, whatever they say (npy says none)")
    shared.add_system(add)
    shared.add_feet(add)
    add_outputs(add)
    shared.add_reading(add)
    shared.add_seed(add)
    shared.add_models(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """One file in, one motion out, in every format asked for."""
    from motionary.formats import read_motion

    span = (options.start, options.end) if (options.start, options.end) != (None, None) else None
    ways = (("--start", span), ("--extend", options.extend), ("--between", options.between))
    asked = [name for name, value in ways if value is not None]
    if len(asked) != 1:
        raise InputError("edit", " ".join(asked) or "nothing asked", "give --start and --end, --extend, or --between")
    if options.seconds is not None and options.between is None:
        raise InputError("--seconds", options.seconds, "is the length of --between")
    name = f"{Path(options.file).stem}-{asked[0].strip('-').replace('start', 'edited')}"
    outputs = Outputs(options)
    read = {"fps": options.source_fps, **shared.reading(options)}
    motion = read_motion(options.file, **read)
    other = read_motion(options.between, **read) if options.between is not None else None
    dictionary = shared.open_models(options)
    made = _made(dictionary, motion, other, options)
    outputs.claim([name])
    read_as = {} if options.text is None else shared.say_reading(dictionary, options.text)
    files = outputs.write(made, name, options.text)
    row = {"file": options.file, "text": options.text, "seed": options.seed, "seconds": round(made.duration, 3)}
    shared.show(options, [row | read_as | {"files": files}], files)


def _made(dictionary: Dictionary, motion: Motion, other: Motion | None, options: argparse.Namespace) -> Motion:
    """What is asked of a motion."""
    asked = (options.seed, options.system, options.feet)
    if other is not None:
        seconds = 1.0 if options.seconds is None else options.seconds
        return dictionary.between(motion, other, seconds, options.text, *asked)
    if options.extend is not None:
        return dictionary.extend(motion, options.extend, options.text, *asked)
    if options.text is None:
        raise InputError("text", "none", "must say what happens from --start to --end")
    start, end = options.start or 0.0, motion.duration if options.end is None else options.end
    return dictionary.edit(motion, options.text, start, end, *asked)


COMMAND = Command(
    "edit",
    "Make a part of a motion anew, go on with it, or lead to another.",
    _arguments,
    _run,
    (
        'motionary edit walk.bvh "a person jumps" --start 1 --end 2.5 --out out',
        'motionary edit walk.bvh "a person sits down" --extend 2',
        "motionary edit walk.bvh --between limp.bvh --seconds 1",
    ),
)
