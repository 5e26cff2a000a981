"""Motions that a command leaves as files: in which folder, in which formats, under which names."""

from __future__ import annotations

import argparse
import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motionary.errors import InputError

if TYPE_CHECKING:
    from motionary.motion import Motion

_TITLED = (".mp4", ".gif", ".html")  # formats that show a caption


def add_outputs(add: argparse.ArgumentParser) -> None:
    """--out, --format, --fps, --onto and --force, for :class:`Outputs`."""
    add.add_argument("--out", default=".", metavar="FOLDER", help="where the files go (here)")
    add.add_argument("--format", default="bvh", metavar="A,B", help="bvh, npz, npy, glb, mp4, gif, html (bvh)")
    add.add_argument("--fps", type=float, help="rate of what is written (as it was made)")
    add_onto(add)
    add_force(add, "existing files")


def add_onto(add: argparse.ArgumentParser) -> None:
    """--onto."""
    told = "a character's bvh or glb, onto whose rig the motion goes; written in its own format it keeps all else"
    add.add_argument("--onto", metavar="FILE", help=told)


def add_force(add: argparse.ArgumentParser, what: str) -> None:
    """--force, which replaces `what`."""
    add.add_argument("--force", action="store_true", help=f"replace {what}")


def known_extension(name: str) -> str:
    """The extension of a format's name; InputError lists those that can be written."""
    from motionary.formats import WRITERS

    extension = f".{name.strip().lstrip('.').lower()}"
    if extension not in WRITERS:
        known = " ".join(name.lstrip(".") for name in WRITERS)
        raise InputError("format", extension.lstrip("."), f"must be among: {known}")
    return extension


def captioned(extension: str, text: str | None) -> dict[str, Any]:
    """The writer's option that shows a text, where the format shows one."""
    return {"captions": text} if text and extension in _TITLED else {}


class Outputs:
    """Files of motions in each format asked for.

    Raises:
        InputError: an unknown format, a rate out of range, a file that is no rig, or a folder that is none.
    """

    def __init__(self, options: argparse.Namespace):
        from motionary.files import writable_folder

        self.folder, self.force, self.onto, self.fps = Path(options.out), options.force, options.onto, options.fps
        if self.fps is not None:
            from motionary.motion.transforms import check_rate

            check_rate(self.fps)
        self.extensions = list(dict.fromkeys(known_extension(name) for name in options.format.split(",")))
        if self.onto is not None:
            from motionary.formats.rig_files import read_rig

            read_rig(self.onto)
        writable_folder(self.folder)

    def claim(self, names: Iterable[str]) -> None:
        """InputError for the first of these names that cannot be written, or is there without --force. Asked once all
        options are known to be right, and before the first file is written."""
        from motionary.files import writable

        for name in names:
            for extension in self.extensions:
                writable(self.folder / f"{name}{extension}", self.force)

    def write(self, motion: Motion, name: str, text: str | None = None) -> list[str]:
        """Writes a motion under a name, with a text where the format shows one, and names the files."""
        from motionary.formats import write_motion
        from motionary.motion import fit_rotations, resample

        motion = fit_rotations(motion)
        motion = motion if self.fps is None else resample(motion, self.fps)
        given = {"force": self.force, "onto": self.onto}
        return [
            str(write_motion(motion, self.folder / f"{name}{e}", **given, **captioned(e, text)))
            for e in self.extensions
        ]


def slug(text: str, otherwise: str, longest: int = 48) -> str:
    """A text as a file's name: letters and digits of any script in lower case, accents left out, hyphens between."""
    plain = re.sub(r"([a-z])[\u0300-\u036f]+", r"\1", unicodedata.normalize("NFKD", text.lower()))
    short = re.sub(r"[\W_]+", "-", unicodedata.normalize("NFC", plain)).strip("-")[:longest]
    return short.strip("-") or otherwise


def variants(name: str, n: int) -> list[str]:
    """The names of n variants: numbered where there are several."""
    return [name] if n == 1 else [f"{name}-{k}" for k in range(n)]
