"""An index of a folder of any size: every clip read once, in parallel; killed anywhere, the next run goes on."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from motionary.archive.parts import SUFFIX, ArchivePart, ClipRow, Readers, make_part, stored
from motionary.archive.stored_index import HIDDEN
from motionary.archive.writing_out import write_out
from motionary.archive.written_results import claim
from motionary.corpus.clips import Clip
from motionary.corpus.shared_rigs import with_shared_rigs
from motionary.corpus.sources import FileMotion, checked_root, source_of
from motionary.corpus.workers import in_order
from motionary.dictionary import Dictionary, load
from motionary.errors import InputError, check_whole
from motionary.files import writable_folder
from motionary.systems.io import model_hash
from motionary.systems.registry import EMBED, MOTION_TO_TEXT

_VERSION = "2"  # of what is read, measured and cut: parts of another are made anew
_CLIPS, _BYTES = 32, 64_000_000  # of a part at most: enough to compute together, little to lose


def index_folder(
    folder: str | Path,
    models: str | Path | None = None,
    out: str | Path | None = None,
    device: str = "auto",
    workers: int = 0,
    progress: bool = True,
    force: bool = False,
) -> dict[str, Any]:
    """Caption, embed and grade all motions of a folder; :class:`motionary.archive.Archive` searches the result.

    Clips are cut into windows of about five seconds. Written are, each whole or not at all: `captions.jsonl`, the sound
    clips with a caption of each window in the format of `clips.jsonl` (what the folder's own says of them stays);
    `flags.jsonl`, the broken clips and why; `duplicates.jsonl`, windows that show nearly the same; and the index, in
    the folder `.motionary`. Clips that were read before and did not change are not read again.

    Args:
        folder: motion files, with or without `clips.jsonl`, or a released layout.
        models: what `dvc repro` built, or a bundle: a system that captions and one that embeds; None as in `load`.
        out: where the results go, the folder itself by default.
        device: where models compute.
        workers: processes; 0 is one for each core.
        progress: show bars.
        force: replace files that are called as the results are, but are not as an earlier index wrote them.

    Returns:
        Counts: "clips", "windows", "hours", "flagged" by flag, "duplicates" and "problems", a list of InputError.

    Raises:
        InputError: no motion, missing models, a place that cannot be written, or a file there that is not of an index.
    """
    check_whole("workers", workers, 0)
    folder = checked_root(Path(folder))
    out = folder if out is None else Path(out)
    claim(out, force)
    readers, version = _readers(load(models, device), device)
    clips, problems = source_of(folder).clips()
    if not clips:
        hint = f"; the first problem: {problems[0]}" if problems else ""
        raise InputError(folder, "no motion", f"must hold at least one clip{hint}")
    workers = workers or os.cpu_count() or 1
    clips = with_shared_rigs(clips, workers)
    parts = out / HIDDEN / f"parts-{version['key']}"
    rigs: dict[Path, list[Path]] = {}
    wanted = {_key(clip, file, rigs): (clip, file) for clip, file in _named(clips, folder)}
    _make(parts, wanted, readers, workers, progress)
    found = write_out(folder, out, _ordered(parts, wanted), version, progress, force)
    for old in (out / HIDDEN).glob("parts-*"):
        if old != parts:
            shutil.rmtree(old, ignore_errors=True)
    return found | {"problems": problems}


def _readers(dictionary: Dictionary, device: str) -> tuple[Readers, dict[str, str]]:
    """The systems that read the archive, and what names them and this version."""
    names = {}
    for role, offer in (("captioner", MOTION_TO_TEXT), ("judge", EMBED)):
        dictionary.opened(offer)  # says what is missing before anything is read
        names[role] = dictionary.offering(offer)[0]
    one, other = (dictionary.context(name) for name in names.values())
    if (one.codec, one.fps, one.skeleton.joints) != (other.codec, other.fps, other.skeleton.joints):
        raise InputError("models", " and ".join(names.values()), "must be trained on one corpus")
    hashes = {f"{role}_hash": model_hash(dictionary.models / name) for role, name in names.items()}
    key = hashlib.sha256(json.dumps([_VERSION, names, hashes]).encode()).hexdigest()[:12]
    return Readers(str(dictionary.models), device, names["captioner"], names["judge"]), {**names, **hashes, "key": key}


def _named(clips: Sequence[Clip], folder: Path) -> Iterator[tuple[Clip, str]]:
    for clip in clips:
        yield clip, os.path.relpath(getattr(clip.load, "path", clip.where), folder)


def _key(clip: Clip, file: str, rigs: dict[Path, list[Path]]) -> str:
    """Names a clip's file, and what is read beside it, as they are now, and how it is read; `rigs` keeps the .asf files
    of each folder."""
    path = Path(getattr(clip.load, "path", clip.where))
    stamps = [_stamp(one) for one in (path, *_companions(path, clip, rigs))]
    told = json.dumps([file, *stamps, clip.fps, repr(clip.load)])
    return hashlib.sha256(told.encode()).hexdigest()[:24]


def _stamp(path: Path) -> tuple[int, int]:
    try:
        state = path.stat()
        return state.st_size, state.st_mtime_ns
    except OSError:
        return 0, 0


def _companions(path: Path, clip: Clip, rigs: dict[Path, list[Path]]) -> list[Path]:
    """Files beside a motion that change what it shows: its skeletons, its buffer, its body."""
    found: list[Path] = []
    if (kind := path.suffix.lower()) == ".amc":
        if path.parent not in rigs:
            rigs[path.parent] = sorted(one for one in path.parent.iterdir() if one.suffix.lower() == ".asf")
        found += rigs[path.parent]
    elif kind == ".gltf":
        found.append(path.with_suffix(".bin"))
    options = clip.load.options if isinstance(clip.load, FileMotion) else None
    if options is not None and options.body is not None:
        found.append(Path(options.body))
    return found


def _make(parts: Path, wanted: dict[str, tuple[Clip, str]], readers: Readers, workers: int, progress: bool) -> None:
    """The parts that are not there yet; those of which nothing is wanted any more go. What could not be read is tried
    again: the disk or the network may be well by now."""
    writable_folder(parts)
    done: set[str] = set()
    for path, part in stored(parts):
        if any(row.key in wanted for row in part.clips):
            done.update(row.key for row in part.clips if not row.problem)
        else:
            path.unlink(missing_ok=True)
    left = [(clip, file, key) for key, (clip, file) in wanted.items() if key not in done]
    jobs = [(some, readers, str(parts / f"{_name(some)}{SUFFIX}")) for some in _grouped(left)]
    with tqdm(
        total=len(wanted), initial=len(wanted) - len(left), desc="index", unit="clip", disable=not progress
    ) as bar:
        for count in in_order(make_part, jobs, min(workers, max(1, len(jobs))), chunk=1):
            bar.update(count)


def _grouped(left: Sequence[tuple[Clip, str, str]]) -> Iterator[list[tuple[Clip, str, str]]]:
    """A few clips at a time, fewer where files are large."""
    some: list[tuple[Clip, str, str]] = []
    size = 0
    for entry in left:
        own = _bytes(entry[0])
        if some and (len(some) == _CLIPS or size + own > _BYTES):
            yield some
            some, size = [], 0
        some.append(entry)
        size += own
    if some:
        yield some


def _bytes(clip: Clip) -> int:
    try:
        return os.stat(getattr(clip.load, "path", clip.where)).st_size
    except OSError:
        return 0


def _name(some: Sequence[tuple[Clip, str, str]]) -> str:
    return hashlib.sha256("".join(key for *_, key in some).encode()).hexdigest()[:16]


def _ordered(parts: Path, wanted: dict[str, tuple[Clip, str]]) -> list[tuple[Clip, ClipRow, ArchivePart, int]]:
    """Every wanted clip in the order of its listing: its row, its part, and where in that its windows begin."""
    found: dict[str, tuple[ClipRow, ArchivePart, int]] = {}
    for _, part in stored(parts):
        first = 0
        for row in part.clips:
            if row.key not in found or not row.problem:  # an older part may hold a problem that is none any more
                found[row.key] = (row, part, first)
            first += len(row.windows)
    return [(clip, *found[key]) for key, (clip, _) in wanted.items() if key in found]
