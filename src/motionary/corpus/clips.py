"""Clips and captions as a source lists them, and the reader of `clips.jsonl`."""

from __future__ import annotations

import json
import math
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from motionary.corpus.checks import check_home, check_unicode, unforeseen
from motionary.errors import InputError, shortened
from motionary.formats.number_rows import LONGEST_LINE, text_lines
from motionary.formats.read.reading_options import Reading, ReadingOptions, nearest_key
from motionary.motion import Motion
from motionary.motion.motion import SLOWEST_RATE
from motionary.motion.roles import READING_KEYS
from motionary.text_files import decoded, text_stream

MOTION_FILES = (".bvh", ".npy", ".npz", ".amc", ".glb", ".gltf", ".c3d")
BARE_ARRAYS = (".npy",)
CLIP_KEYS = ("motion", "fps", "subject", "style", "action", "skeleton", "captions", "mapping", *READING_KEYS)
CAPTION_KEYS = ("text", "start", "end", "source")
LONGEST_CAPTION = 1000
_MOST_CAPTIONS = 1000  # of a clip, each of which may ask for a window of its own
LONGEST_LABEL = 100
_LONGEST_LISTING = 1 << 29  # bytes
TOLERANCE = 0.1  # s by which a caption may overhang its clip: labels are rounded to frames of another rate


@dataclass(frozen=True)
class Caption:
    """A sentence about a stretch of a clip, in seconds; None is the clip's own start or end. `source` names where
    the sentence comes from ("humanml3d", "class-template", ...; "" where unknown); `tokens` are its tagged words
    ("walk/VERB") where a release brings them."""

    text: str
    start: float | None = None
    end: float | None = None
    source: str = ""
    tokens: tuple[str, ...] = ()

    @property
    def human(self) -> bool:
        """Whether a person wrote it, as far as its source tells: not a template nor the demo's grammar."""
        return "template" not in self.source and self.source != "grammar"


class Loader(Protocol):
    """Reads one clip's motion; picklable, since it runs in another process. Demo clips bring their labels along."""

    def __call__(self, clip: Clip) -> tuple[Motion, Clip]: ...


@dataclass(frozen=True)
class Clip:
    """One source clip.

    Attributes:
        id: unique over all roots, `<root name>/<path without extension>`.
        load: reads the motion (see `Loader`).
        where: file and line to name in a complaint.
        split: "train", "val" or "test" where the source says so, else "".
        origin: id of the clip that this one is a mirrored copy of, else its own.
        mirrored: the source's own mirrored copy.
        attributes: what is true of the motion as JSON, where the source knows (the demo grammar), else "".
        mirrors: whether preprocess may add a mirrored copy (False where the source brings its own).
        reading: how the file was read, once it is.
    """

    id: str
    load: Loader
    where: str
    group: str
    fps: float | None = None
    subject: str = ""
    style: str = ""
    action: str = ""
    captions: tuple[Caption, ...] = ()
    attributes: str = ""
    split: str = ""
    origin: str = ""
    mirrored: bool = False
    mirrors: bool = True
    reading: Reading | None = None

    def __post_init__(self):
        if not self.origin:
            object.__setattr__(self, "origin", self.id)


def checked_captions(clip: Clip, duration: float) -> tuple[Clip, list[InputError]]:
    """The clip with every caption inside 0 .. duration (s): overhang up to 0.1 s is clamped, more drops the caption."""
    kept, problems = [], []
    for caption in clip.captions:
        start = 0.0 if caption.start is None else caption.start
        end = duration if caption.end is None else caption.end
        if start < -TOLERANCE or end > duration + TOLERANCE or start >= min(end, duration):
            span = f"{start:g}..{end:g} s"
            problems.append(InputError(clip.where, span, f"caption must lie inside the clip, 0..{duration:.2f} s"))
            continue
        kept.append(replace(caption, start=max(start, 0.0), end=min(end, duration)))
    return replace(clip, captions=tuple(kept)), problems


def problem_rows(problems: list[InputError], prefix: str = "", most: int = 500) -> list[dict[str, str]]:
    """The first problems for a report; `prefix` (where the project lies) is left out of file names."""
    return [
        {"file": problem.what.replace(prefix, ""), "value": shortened(problem.value, 200), "rule": problem.rule}
        for problem in problems[:most]
    ]


def read_listing(path: Path, parse, where: str | None = None) -> tuple[list, list[InputError]]:
    """Parse each line of a JSON-lines file; a bad line becomes a problem that names file and line.

    Args:
        parse: (values: dict, where: str, problems: list) -> item or None; may raise InputError.
        where: how to name the file in complaints (default: the path).
    """
    items, problems = [], []
    with text_stream(path) as file:
        if (size := file.seek(0, 2)) > _LONGEST_LISTING:
            rule = f"a listing may have {_LONGEST_LISTING:,}; what follows is left out (is it damaged?)"
            problems.append(InputError(where or path, f"{size:,} bytes", rule))
        file.seek(0)
        for number, given in enumerate(text_lines(file, min(size, _LONGEST_LISTING)), 1):
            place = f"{where or path}:{number}"
            if len(given) > LONGEST_LINE:
                rule = "must be one JSON object per line (is it damaged?)"
                problems.append(InputError(place, f"more than {LONGEST_LINE:,} bytes", rule))
                continue
            if not (line := decoded(given)).strip():
                continue
            try:
                values = json.loads(line)
                if not isinstance(values, dict):
                    raise InputError(place, line.strip(), "must be one JSON object per line")
                items.append(parse(values, place, problems))
            except InputError as problem:
                problems.append(problem)
            except (ValueError, RecursionError):  # ValueError: also numbers of more digits than Python converts
                problems.append(InputError(place, line.strip(), "must be one JSON object per line"))
            except Exception as error:  # one bad line never ends a run
                problems.append(unforeseen(place, error))
    return items, problems


def reading(root: Path, values: dict[str, Any], where: str) -> ReadingOptions | None:
    """What a line says of how its motion is to be read; its mapping is a file in the folder, or the object itself."""
    told = {key: values[key] for key in READING_KEYS if values.get(key) is not None}
    if isinstance(told.get("body"), str):
        told["body"] = str(root / told["body"])
    mapping = values.get("mapping")
    if mapping is None:
        return ReadingOptions.told_at(where, **told) if told else None
    if not isinstance(mapping, str | dict):
        raise InputError(f"{where}: mapping", mapping, "must be a JSON file's path, or an object: role to joint name")
    given = ReadingOptions.from_mapping(root / mapping if isinstance(mapping, str) else mapping)
    return ReadingOptions.told_at(where, **told).over(given)


def unknown_keys(values: dict[str, Any], known: tuple[str, ...], where: str, seen: set[str]) -> list[InputError]:
    """A problem for each key that nothing reads (perhaps a typing error), the first time that it is seen."""
    new = [key for key in values if key not in known and key not in seen]
    seen.update(new)
    rule = f"is no known key and is left out; known are {', '.join(known)}"
    return [InputError(where, key, rule + nearest_key(key, known)) for key in new]


def label(values: dict[str, Any], key: str, where: str) -> str:
    """A short string or nothing."""
    value = values.get(key)
    if value is None:
        return ""
    if not isinstance(value, str) or len(value) > LONGEST_LABEL:
        raise InputError(f"{where}: {key}", value, f"must be a string of at most {LONGEST_LABEL} characters")
    check_unicode(value, f"{where}: {key}")
    return value.strip()


def inside(root: Path, values: dict[str, Any], where: str) -> PurePosixPath:
    """The path of a listed motion, relative to its folder; it must exist there and be of a known kind. Where it does
    not, Windows' separators and the other composition of accents, as macOS stores names, are tried."""
    value = values.get("motion")
    if not isinstance(value, str) or not value:
        raise InputError(f"{where}: motion", value, "must be the path of a motion file inside the folder")
    spelled = (value, value.replace("\\", "/"))
    ways = (unicodedata.normalize(form, way) for way in spelled for form in ("NFC", "NFD"))
    relative = PurePosixPath(next((way for way in (value, *ways) if _is_file(root / way)), value))
    if relative.is_absolute() or ".." in relative.parts:
        raise InputError(f"{where}: motion", value, "must stay inside the folder")
    if relative.suffix.lower() not in MOTION_FILES:
        raise InputError(f"{where}: motion", value, f"must end in {', '.join(MOTION_FILES)}")
    check_unicode(value, f"{where}: motion")
    if not _is_file(root / relative):
        raise InputError(f"{where}: motion", value, "is listed but absent")
    check_home(root, root / relative, f"{where}: motion")
    return relative


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # longer than a name can be, or no name
        return False


def rate(values: dict[str, Any], relative: PurePosixPath, where: str) -> float | None:
    """Frames per second of a listed motion, None where the file itself tells."""
    value = values.get("fps")
    if value is None:
        if relative.suffix.lower() in BARE_ARRAYS:
            raise InputError(f"{where}: fps", "missing", "is needed for arrays")
        return None
    if not _number(value) or not SLOWEST_RATE <= value <= 1000:
        raise InputError(f"{where}: fps", value, f"must be above 0: a rate from {SLOWEST_RATE:g} to 1000")
    return float(value)


def captions(
    values: dict[str, Any], where: str, problems: list[InputError], seen: set[str] | None = None
) -> tuple[Caption, ...]:
    """The usable captions of a line; a bad one becomes a problem and is left out, and so does a key not yet `seen`."""
    listed = values.get("captions") or []
    if not isinstance(listed, list):
        raise InputError(f"{where}: captions", listed, "must be a list of {text, start, end, source}")
    if len(listed) > _MOST_CAPTIONS:
        rule = f"a clip may have {_MOST_CAPTIONS:,}; the others are left out"
        problems.append(InputError(f"{where}: captions", f"{len(listed):,}", rule))
    return tuple(_usable(listed[:_MOST_CAPTIONS], where, problems, set() if seen is None else seen))


def check_text(text: Any, where: str) -> str:
    """A caption's text, stripped; InputError where it is empty, huge or not English."""
    if not isinstance(text, str) or not text.strip():
        raise InputError(where, text, "caption must be a non-empty string")
    check_unicode(text, where)
    text = " ".join(text.split())
    if len(text) > LONGEST_CAPTION:
        shown = f"{text[:40]}... ({len(text)} characters)"
        raise InputError(where, shown, f"caption must have at most {LONGEST_CAPTION} characters")
    letters = [character for character in text if character.isalpha()]
    if not letters or sum(character.isascii() for character in letters) < 0.75 * len(letters):
        raise InputError(where, text, "caption must be English")
    return text


def _usable(listed: list, where: str, problems: list[InputError], seen: set[str]) -> Iterator[Caption]:
    for position, entry in enumerate(listed):
        place = f"{where}: captions[{position}]"
        try:
            if not isinstance(entry, dict):
                raise InputError(place, entry, "must be an object {text, start, end, source}")
            problems += unknown_keys(entry, CAPTION_KEYS, place, seen)
            text = check_text(entry.get("text"), f"{place}.text")
            times = [entry.get(key) for key in ("start", "end")]
            for key, time in zip(("start", "end"), times, strict=True):
                if time is not None and not _number(time):
                    raise InputError(f"{place}.{key}", time, "must be a finite number of seconds")
            yield Caption(text, *times, source=label(entry, "source", place))
        except InputError as problem:
            problems.append(problem)


def _number(value: Any) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False
