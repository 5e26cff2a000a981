"""Options that several commands share: each is added here, and what it asks for is done here."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

from motionary.errors import MOST_ASKED, STRONGEST, InputError

if TYPE_CHECKING:
    from motionary.dictionary import Dictionary
    from motionary.motion import Motion

T = TypeVar("T")
R = TypeVar("R")
_MOST_TEXT = 10_000_000  # bytes of prompts
READ = "bvh, amc, npz, npy, glb, gltf or c3d"


def count(text: str) -> int:
    """The type of an option: a whole number of at least 1, at most 10,000."""
    value = int(text)
    if not 1 <= value <= MOST_ASKED:
        shown = text if len(text) < 20 else f"a number of {len(text)} digits"
        raise argparse.ArgumentTypeError(f"{shown}: must be from 1 to {MOST_ASKED:,}")
    return value


count.__name__ = "whole number"  # argparse names the type in its messages


def above_zero(text: str) -> float:
    """The type of an option: a number above 0."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text}: must be a number above 0")
    return value


def share(text: str) -> float:
    """The type of an option: a share, above 0."""
    value = float(text)
    if not 0 < value <= 1:
        raise argparse.ArgumentTypeError(f"{text}: must be a number above 0, at most 1")
    return value


def strength(text: str) -> float:
    """The type of --strength: times a style."""
    value = float(text)
    if not 0 <= value <= STRONGEST:
        raise argparse.ArgumentTypeError(f"{text}: must be a number from 0 to {STRONGEST}")
    return value


def _seed(text: str) -> int:
    """The type of --seed: a whole number of at least 0."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{value}: must be a whole number, at least 0")
    return value


above_zero.__name__, _seed.__name__ = "number", "whole number"


# The models that answer -------------------------------------------------------------------------------------------


def add_models(add: argparse.ArgumentParser) -> None:
    """--models and --device, for :func:`open_models`."""
    told = "what `dvc repro` built ($MOTIONARY_MODELS, else models here, else the packaged ones)"
    add.add_argument("--models", metavar="FOLDER", help=told)
    add.add_argument("--device", default="auto", help="auto, cpu or cuda")


def add_seed(add: argparse.ArgumentParser) -> None:
    """--seed."""
    add.add_argument("--seed", type=_seed, default=0, help="equal seeds repeat on one machine (0)")


def add_system(add: argparse.ArgumentParser) -> None:
    """--system."""
    add.add_argument("--system", help="which system answers (the usual one)")


def add_feet(add: argparse.ArgumentParser) -> None:
    """--feet and --no-feet."""
    told = "feet stand still while they stand (yes); --no-feet: as the models made them"
    add.add_argument("--feet", action=argparse.BooleanOptionalAction, default=True, help=told)


def open_models(options: argparse.Namespace) -> Dictionary:
    """The dictionary of --models."""
    from motionary.dictionary import load

    return load(options.models, options.device)


def check_style(dictionary: Dictionary, options: argparse.Namespace) -> None:
    """InputError where --style is given and no model knows it."""
    from motionary.dictionary.restyling import label_of
    from motionary.systems.registry import STYLIZE

    if options.style is not None:
        label_of(dictionary.opened(STYLIZE), options.style)


# Prompts ----------------------------------------------------------------------------------------------------------


def add_prompts(add: argparse.ArgumentParser) -> None:
    """PROMPT and --file, for :func:`read_prompts`."""
    add.add_argument("prompts", nargs="*", metavar="PROMPT", help="an English text; - reads standard input")
    add.add_argument("--file", metavar="FILE", help="prompts from a text file, one a line")


def read_prompts(options: argparse.Namespace) -> list[str]:
    """Prompts of the command line, of --file, or of standard input ("-", or nothing given), one a line."""
    from motionary.language import check_prompt

    given, file = options.prompts, options.file
    if given and given != ["-"]:
        if file is not None:
            raise InputError("--file", file, "give prompts or a file of them, not both")
        return [check_prompt(text, "prompt") for text in given]
    if file is None and not given and sys.stdin.isatty():
        raise InputError("prompt", "none", "give one, or --file, or lines on standard input")
    where = "standard input" if file in (None, "-") else str(file)
    try:
        with nullcontext(sys.stdin) if where == "standard input" else _opened(where) as lines:
            text = lines.read(_MOST_TEXT + 1)
    except UnicodeDecodeError:
        raise InputError(where, "not text", "must be a text file in UTF-8 with one prompt a line") from None
    if len(text) > _MOST_TEXT:
        raise InputError(where, "too long", f"prompts may have {_MOST_TEXT:,} letters in all")
    lines = [(number, line) for number, line in enumerate(text.removeprefix("\ufeff").splitlines(), 1) if line.strip()]
    if not lines:
        raise InputError(where, "empty", "must hold one prompt a line, where none is given as an argument")
    return [check_prompt(line, f"{where}, line {number}") for number, line in lines]


def _opened(file: str) -> TextIO:
    """A file of prompts."""
    from motionary.files import exists

    path = Path(file)
    if not exists(path) or path.is_dir():
        raise InputError(file, "a folder" if path.is_dir() else "missing", "must be a text file with one prompt a line")
    return open(path, encoding="utf-8-sig")


def say_reading(dictionary: Dictionary, text: str) -> dict[str, Any]:
    """How a prompt is read, as JSON shows it; what a reader must know of it is a line on standard error."""
    reading = dictionary.reading(text)
    if reading.line:
        print(f"note: {reading.line}", file=sys.stderr)
    return reading.record()


# Motion files -----------------------------------------------------------------------------------------------------


def add_files(add: argparse.ArgumentParser, told: str = "", rate: str = "--fps") -> None:
    """FILE, one or several, and their rate, whatever they say: --source-fps where --fps is that of results. `told`
    goes on about the files."""
    add.add_argument("files", nargs="+", metavar="FILE", help=f"{READ}{told}")
    add.add_argument(rate, dest="source_fps", type=float, help="rate of the files, whatever they say (npy says none)")


def add_reading(add: argparse.ArgumentParser) -> None:
    """What the user knows of the files, where they are not to be measured, for :func:`reading`."""
    told = "JSON with the joint's name by role, for a rig that is not known, and these options"
    add.add_argument("--mapping", metavar="FILE", help=told)
    add.add_argument("--up", metavar="AXIS", help="what points up: y, z, x, or as --up=-y with a minus (measured)")
    add.add_argument("--unit", help="m, cm, mm, dm, in, ft, cmu or metres per unit (measured)")
    yes_no = argparse.BooleanOptionalAction
    add.add_argument("--mirror", action=yes_no, help="swap left and right, as left-handed files need (measured)")
    add.add_argument("--skip-first", action=yes_no, help="leave out the first frame (where it is a calibration pose)")
    add.add_argument("--animation", metavar="NAME", help="which one of a glb or gltf (the first that moves joints)")
    add.add_argument("--body", metavar="FILE", help="a body model's npz, for AMASS files (SMPL's mean body)")


def reading(options: argparse.Namespace) -> dict[str, Any]:
    """The arguments of `read_motion` that :func:`add_reading` gives, and a bar for long files where people look on."""
    names = ("mapping", "up", "unit", "mirror", "skip_first", "animation", "body")
    given = {name: getattr(options, name) for name in names}
    return {**given, "progress": sys.stderr.isatty()}


def add_cut(add: argparse.ArgumentParser) -> None:
    """--start and --end, for :func:`cut`."""
    add.add_argument("--start", type=float, help="seconds from which the motion counts")
    add.add_argument("--end", type=float, help="seconds up to which it counts")


def read_files(options: argparse.Namespace) -> dict[str, Motion]:
    """The motions of FILE by file, cut. A file that cannot be read is said, and the others stay (see :func:`each`)."""
    from motionary.formats import read_motion

    def read(path: str) -> Motion:
        """One file, read and cut as asked."""
        return cut(read_motion(path, fps=options.source_fps, **reading(options)), options)

    return each(options, {path: path for path in options.files}, read)


def each(options: argparse.Namespace, given: Mapping[str, T], done: Callable[[T], R]) -> dict[str, R]:
    """What is done to each file's value. One that fails is said with its file's name, and the command ends with code 2
    after the others are done.

    Raises:
        InputError: an option is wrong, or all failed; of several, all but the last were said.
    """
    found: dict[str, R] = {}
    errors: dict[str, InputError] = {}
    asked = {*vars(options), "fps", options.mapping}
    for file, value in given.items():
        try:
            found[file] = done(value)
        except InputError as error:
            if error.what.strip("-") in asked:
                raise  # of no single file: an option is wrong
            errors[file] = error
    if 1 < len(errors) == len(set(options.files)) and len({str(error) for error in errors.values()}) == 1:
        raise next(iter(errors.values()))  # what all files have in common is said once
    lines = [_named(error, file, getattr(options, "models", None), options.mapping) for file, error in errors.items()]
    for line in lines[: None if found else -1]:
        print(f"error: {line}", file=sys.stderr)
    if not found:
        raise lines[-1]
    options.failed = options.failed or bool(lines)
    return found


def all_or_each(
    options: argparse.Namespace, motions: Mapping[str, Motion], done: Callable[[list[Motion]], list[R]]
) -> dict[str, R]:
    """What is done to all motions together, by file; where that fails, to each alone (see :func:`each`)."""
    try:
        return dict(zip(motions, done(list(motions.values())), strict=True))
    except InputError:
        return each(options, motions, lambda motion: done([motion])[0])


@contextmanager
def naming(file: str | os.PathLike, *others: str | os.PathLike | None) -> Iterator[None]:
    """Complaints of the block name the file, whatever in it they are about, unless they name an option or one of the
    `others`."""
    try:
        yield
    except InputError as error:
        raise _named(error, file, *others) from None


def _named(error: InputError, *files: str | os.PathLike | None) -> InputError:
    """The error with the first file before it, unless it names one of the files or an option."""
    told = error.what.startswith("--") or any(str(name) in error.what for name in files if name)
    return error if told else error.of(files[0])


def cut(motion: Motion, options: argparse.Namespace) -> Motion:
    """The seconds from --start to --end."""
    if options.start is None and options.end is None:
        return motion
    start, end = options.start or 0.0, motion.duration if options.end is None else options.end
    if not 0 <= start < end <= motion.duration + 1e-6:
        rule = f"must be 0 <= start < end <= {motion.duration:.3f}"
        raise InputError("--start, --end", f"{start:g} to {end:g} s", rule)
    first = round(start * motion.fps)
    return motion.crop(first, max(first + 1, min(motion.frames, round(end * motion.fps))))


# What is printed --------------------------------------------------------------------------------------------------


def add_json(add: argparse.ArgumentParser) -> None:
    """--json, for :func:`show`."""
    add.add_argument("--json", action="store_true", help="print JSON")


def show(options: argparse.Namespace, rows: Sequence[dict[str, Any]], lines: Sequence[str]) -> None:
    """Prints rows as JSON where asked, lines otherwise."""
    print(json.dumps(rows, indent=1, ensure_ascii=False) if options.json else "\n".join(lines))
