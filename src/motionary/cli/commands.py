"""The dictionary in a shell: ``motionary generate|caption|stylize|search|convert|view``. Results go to standard output
and nothing else does; bad input is one line on standard error and exit code 2."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from motionary.cli.arguments import build_parser
from motionary.errors import InputError

CHUNK = 128  # motions generated and written before the next are begun, so that memory does not grow with the prompts
TITLED = (".mp4", ".gif", ".html")  # formats that show a caption


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code: 0, 2 on bad input, 130 when interrupted."""
    try:
        options = build_parser(COMMANDS).parse_args(arguments)
        options.run(options)
        sys.stdout.flush()
        return 0
    except BrokenPipeError:  # the reader of a pipe went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


# Commands -------------------------------------------------------------------------------------------------------


def generate(options: argparse.Namespace) -> None:
    """Motions for prompts, each in every format asked for."""
    from tqdm import tqdm

    from motionary.files import writable
    from motionary.formats import write_motion

    prompts, extensions = _prompts(options.prompts, options.file), _extensions(options.format)
    names = _names(prompts, options.n)
    folder = Path(options.out)
    for name in names:
        for extension in extensions:
            writable(folder / f"{name}{extension}", options.force)
    dictionary = _load(options)
    rows: list[dict[str, Any]] = []
    chunk = max(1, CHUNK // max(1, options.n))
    chosen = {key: value for key in ("temperature", "top_p") if (value := getattr(options, key)) is not None}
    with tqdm(total=len(names), unit="motion", desc="generate", disable=len(names) < 4) as bar:
        for first in range(0, len(prompts), chunk):
            part = prompts[first : first + chunk]
            motions = dictionary.generate(part, options.n, options.seconds, options.system, options.seed, **chosen)
            if options.style is not None:
                motions = [_restyled(dictionary, variants, options) for variants in motions]
            for text, variants in zip(part, motions, strict=True):
                for variant, motion in enumerate(variants):
                    name = names[len(rows)]
                    files = []
                    for extension in extensions:
                        titled = {"captions": text} if extension in TITLED else {}
                        path = write_motion(motion, folder / f"{name}{extension}", force=options.force, **titled)
                        files.append(str(path))
                    read_as, seconds = dictionary.read_as(text), round(motion.duration, 3)
                    row = {"text": text, "read_as": read_as, "seed": options.seed, "variant": variant}
                    rows.append({**row, "seconds": seconds, "files": files})
                    bar.update()
    _print(options, rows, [file for row in rows for file in row["files"]])


def caption(options: argparse.Namespace) -> None:
    """Sentences for motion files."""
    from motionary.formats import read_motion

    motions = [_cut(read_motion(path, options.mapping, fps=options.fps), options) for path in options.files]
    names = ("n", "beams", "system", "seed", "temperature", "consensus")
    found = _load(options).caption(motions, **{name: getattr(options, name) for name in names})
    several = len(found) > 1
    lines = [
        f"{path}\t{text}" if several else text
        for path, texts in zip(options.files, found, strict=True)
        for text in texts
    ]
    _print(options, [{"file": f, "captions": texts} for f, texts in zip(options.files, found, strict=True)], lines)


def stylize(options: argparse.Namespace) -> None:
    """Motion files in another style, in every format asked for."""
    from motionary.files import writable
    from motionary.formats import read_motion, write_motion

    extensions, given = _extensions(options.format), {"mapping": options.mapping, "fps": options.fps}
    motions = [_cut(read_motion(path, **given), options) for path in options.files]
    reference = None if options.reference is None else read_motion(options.reference, **given)
    told = options.style or (Path(options.reference).stem if options.reference else "restyled")
    stems = [Path(path).stem for path in options.files]
    if len(set(stems)) < len(stems):
        stems = [f"{i}-{stem}" for i, stem in enumerate(stems)]
    bases = [f"{stem}-{told}" for stem in stems]
    names = [[base] if options.n == 1 else [f"{base}-{k}" for k in range(options.n)] for base in bases]
    folder = Path(options.out)
    for name in (name for row in names for name in row):
        for extension in extensions:
            writable(folder / f"{name}{extension}", options.force)
    found = _load(options).stylize(motions, options.style, reference, options.n, options.seed, options.strength)
    rows: list[dict[str, Any]] = []
    for path, row, variants in zip(options.files, names, found, strict=True):
        for variant, (name, motion) in enumerate(zip(row, variants, strict=True)):
            files = [str(write_motion(motion, folder / f"{name}{ext}", force=options.force)) for ext in extensions]
            what = {"file": path, "style": options.style, "reference": options.reference, "seed": options.seed}
            rows.append(what | {"variant": variant, "seconds": round(motion.duration, 3), "files": files})
    _print(options, rows, [file for row in rows for file in row["files"]])


def search(options: argparse.Namespace) -> None:
    """Windows of the corpus for prompts."""
    prompts = _prompts(options.prompts, options.file)
    found = _load(options).search(prompts, options.k)
    rows, lines = [], []
    for text, matches in zip(prompts, found, strict=True):
        keys = ("id", "origin", "start", "end", "distance", "captions")
        rows.append({"text": text, "matches": [{key: getattr(match, key) for key in keys} for match in matches]})
        for match in matches:
            said = match.captions[0] if match.captions else "-"
            lines.append(f"{match.distance:.3f}\t{match.id}\t{match.start:.2f}-{match.end:.2f} s\t{said}")
    _print(options, rows, lines)


def convert(options: argparse.Namespace) -> None:
    """One motion file into another format."""
    from motionary.files import writable
    from motionary.formats import read_motion, write_motion
    from motionary.motion import Skeleton, resample, retarget

    (extension,) = _extensions(Path(options.target).suffix or "none")
    writable(options.target, options.force)
    motion = _cut(read_motion(options.source, options.mapping, fps=options.source_fps), options)
    if options.skeleton is not None:
        motion = retarget(motion, Skeleton.named(options.skeleton))
    if options.fps is not None:
        motion = resample(motion, options.fps)
    titled = {"captions": options.caption} if extension in TITLED and options.caption else {}
    print(write_motion(motion, options.target, force=options.force, **titled))


def view(options: argparse.Namespace) -> None:
    """A page that plays motion files side by side."""
    from motionary.formats import read_motion
    from motionary.formats.render.page import write_page

    motions = [read_motion(path, fps=options.fps) for path in options.files]
    target = options.out
    if target is None:
        target = Path(tempfile.mkdtemp(prefix="motionary-")) / "motions.html"
    elif Path(target).suffix.lower() != ".html":
        raise InputError("--out", target, "a player's name must end in .html")
    path = write_page(motions, target, [Path(name).stem for name in options.files], force=options.force)
    print(path)
    if not options.no_open:
        import webbrowser

        webbrowser.open(path.resolve().as_uri())


def app(options: argparse.Namespace) -> None:
    """The page, until interrupted."""
    from motionary.app.server import serve

    serve(options.models, options.device, options.host, options.port, options.origin)


COMMANDS = {
    "generate": generate,
    "caption": caption,
    "stylize": stylize,
    "search": search,
    "convert": convert,
    "view": view,
    "app": app,
}

# Input and output -----------------------------------------------------------------------------------------------


def _load(options: argparse.Namespace):
    from motionary.dictionary.dictionary import load

    return load(options.models, options.device)


def _restyled(dictionary, variants: list, options: argparse.Namespace) -> list:
    """Generated motions in the style asked for, each variant with a draw of its own."""
    draws = (dictionary.stylize(m, options.style, seed=options.seed + k) for k, m in enumerate(variants))
    return [motion for (motion,) in draws]


def _prompts(given: Sequence[str], file: str | None) -> list[str]:
    """Prompts of the command line, of a file, or of standard input ("-", or nothing given), one a line."""
    from motionary.language import check_prompt

    if given and list(given) != ["-"]:
        if file is not None:
            raise InputError("--file", file, "give prompts or a file of them, not both")
        return [check_prompt(text, "prompt") for text in given]
    if file is None and not given and sys.stdin.isatty():
        raise InputError("prompt", "none", "give one, or --file, or lines on standard input")
    where = "standard input" if file in (None, "-") else str(file)
    try:
        text = sys.stdin.read() if where == "standard input" else Path(where).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(where, error, "must be a text file with one prompt a line") from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise InputError(where, "empty", "must hold one prompt a line")
    return [check_prompt(line, f"{where}, line {number}") for number, line in lines]


def _extensions(formats: str) -> list[str]:
    from motionary.formats import WRITERS

    wanted = [f".{name.strip().lstrip('.').lower()}" for name in formats.split(",")]
    for extension in wanted:
        if extension not in WRITERS:
            known = " ".join(name.lstrip(".") for name in WRITERS)
            raise InputError("format", extension.lstrip("."), f"must be among: {known}")
    return list(dict.fromkeys(wanted))


def _names(prompts: Sequence[str], n: int) -> list[str]:
    """A file name for every motion, without extension: numbered where there are several."""
    width = len(str(len(prompts) - 1))
    names = []
    for i, text in enumerate(prompts):
        slug = re.sub(r"[^a-z0-9]+", "-", text.lower())[:48].strip("-") or "motion"
        base = slug if len(prompts) == 1 else f"{i:0{width}d}-{slug}"
        names += [base] if n == 1 else [f"{base}-{k}" for k in range(n)]
    return names


def _cut(motion, options: argparse.Namespace):
    """The seconds from --start to --end."""
    if options.start is None and options.end is None:
        return motion
    start, end = options.start or 0.0, motion.duration if options.end is None else options.end
    if not 0 <= start < end <= motion.duration + 1e-6:
        rule = f"must be 0 <= start < end <= {motion.duration:.3f}"
        raise InputError("--start, --end", f"{start:g} to {end:g} s", rule)
    first = round(start * motion.fps)
    return motion.crop(first, max(first + 1, min(motion.frames, round(end * motion.fps))))


def _print(options: argparse.Namespace, rows: list[dict[str, Any]], lines: Sequence[str]) -> None:
    """Rows as JSON where asked, lines otherwise."""
    print(json.dumps(rows, indent=1, ensure_ascii=False) if options.json else "\n".join(lines))
