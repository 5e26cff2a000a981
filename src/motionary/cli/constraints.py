"""Options of the shell that say where motion goes, through which poses, and how motions follow each other."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from motionary.errors import InputError, shortened

if TYPE_CHECKING:
    from motionary.motion import Motion


def lengths(text: str) -> list[float]:
    """The type of --seconds: one number, or several between commas."""
    return [float(part) for part in text.split(",")]


lengths.__name__ = "numbers between commas"  # argparse names the type in its messages


def points(text: str) -> list[list[float]]:
    """The type of --path: x,z pairs between blanks."""
    from motionary.motion.paths import read_points

    try:
        return read_points(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(f"{shortened(text)}: {error.rule}") from None


points.__name__ = "points x,z between blanks"


def add_constraints(add: argparse.ArgumentParser) -> None:
    """--join, --loop, --path and --keyframe."""
    add.add_argument("--join", action="store_true", help="one motion of all prompts, one after the other")
    add.add_argument("--loop", action="store_true", help="end as it begins, so that it can be repeated")
    told = "go along these points of the ground, in metres: x to the left, z ahead; --seconds: or as long as it takes"
    add.add_argument("--path", type=points, metavar='"X,Z X,Z"', help=told)
    told = "a pose at a time: the frame of FILE at so many seconds (0); several times for several"
    add.add_argument("--keyframe", action="append", default=[], metavar="SECONDS=FILE[@SECONDS]", help=told)


def read_keyframes(options: argparse.Namespace) -> dict[float, Motion]:
    """The poses of --keyframe by their times; InputError names the one that is wrong."""
    found: dict[float, Motion] = {}
    for text in options.keyframe:
        at, _, file = text.partition("=")
        try:
            seconds = float(at)
        except ValueError:
            raise InputError("--keyframe", text, "must be SECONDS=FILE or SECONDS=FILE@SECONDS") from None
        if seconds in found:
            raise InputError("--keyframe", text, f"there is another pose at {seconds:g} s")
        found[seconds] = _pose(text, file)
    return found


def _pose(text: str, file: str) -> Motion:
    """The frame of a file, the first or the one at the seconds after @."""
    from motionary.formats import read_motion

    name, _, at = file.rpartition("@") if "@" in file and not Path(file).exists() else (file, "", "0")
    if not name:
        raise InputError("--keyframe", text, "must name a file behind the seconds")
    try:
        seconds = float(at)
    except ValueError:
        raise InputError("--keyframe", text, "what follows @ must be seconds") from None
    motion = read_motion(name)
    if not 0 <= seconds <= motion.duration:
        raise InputError("--keyframe", text, f"{name} lasts {motion.duration:g} s")
    frame = min(round(seconds * motion.fps), motion.frames - 1)
    return motion.crop(frame, frame + 1)
