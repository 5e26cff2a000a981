"""``motionary convert``: one motion file into another format."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import add_force, add_onto, captioned, known_extension


def _arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("source", metavar="IN", help=shared.READ)
    add.add_argument("target", metavar="OUT", help="bvh, npz, npy, glb, mp4, gif or html")
    add.add_argument("--fps", type=float, help="rate of the result")
    add.add_argument("--source-fps", type=float, help="rate of the file, whatever it says (npy says none)")
    add.add_argument("--skeleton", help="retarget to smpl22 or kit21")
    add_onto(add)
    add.add_argument("--caption", help="shown in mp4, gif and html")
    add_force(add, "an existing file")
    shared.add_reading(add)
    add.add_argument("-v", "--verbose", action="store_true", help="say on standard error how the file was read")
    shared.add_cut(add)


def _run(options: argparse.Namespace) -> None:
    """One motion file into another format."""
    from motionary.files import writable
    from motionary.formats import write_motion
    from motionary.formats.read import read_motion_warning
    from motionary.motion import Skeleton, resample, retarget

    extension = known_extension(Path(options.target).suffix or "none")
    with shared.naming(options.source, options.target, options.onto, options.mapping):
        motion, read = read_motion_warning(options.source, fps=options.source_fps, **shared.reading(options))
        if options.verbose:
            print(f"{options.source}: {read.line()}", file=sys.stderr)
        motion = shared.cut(motion, options)
        if options.skeleton is not None:
            motion = retarget(motion, Skeleton.named(options.skeleton))
        if options.fps is not None:
            motion = resample(motion, options.fps)
        writable(options.target, options.force)
        given = {"force": options.force, "onto": options.onto}
        print(write_motion(motion, options.target, **given, **captioned(extension, options.caption)))


COMMAND = Command(
    "convert",
    "Turn a motion file into another format.",
    _arguments,
    _run,
    (
        "motionary convert in.bvh out.glb --fps 30",
        "motionary convert in.npz out.glb --onto character.glb",
        'motionary convert walk.npz walk.mp4 --caption "a walk"',
    ),
)
