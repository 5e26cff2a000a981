"""Where clips come from: the demo grammar, a folder of motions, or the released HumanML3D layout."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from tqdm import tqdm

from motionary.corpus.checks import check_home, check_unicode
from motionary.corpus.clips import (
    BARE_ARRAYS,
    CLIP_KEYS,
    MOTION_FILES,
    Caption,
    Clip,
    captions,
    inside,
    label,
    problem_rows,
    rate,
    read_listing,
    reading,
    unknown_keys,
)
from motionary.corpus.config import DataConfig
from motionary.corpus.files_of_root import Stock, belongs
from motionary.corpus.humanact12 import labels_of
from motionary.corpus.released import HumanML3DSource
from motionary.errors import InputError
from motionary.formats.read import ReadingOptions, read_motion_with
from motionary.motion import Motion, Skeleton

MAPPING = "mapping.json"
_NEARLY = ("clips.jsonl", "clips.json", "clips.jsonl.txt", "clips.ndjson")
KNOWN_SKELETONS = ("smpl22", "kit21")


class Source(Protocol):
    """A place that lists clips.

    Attributes:
        name: becomes the group of its clips.
    """

    name: str

    def clips(self) -> tuple[list[Clip], list[InputError]]:
        """All clips, sorted by id, and the problems found while listing them. Reads no motion."""
        ...


@dataclass(frozen=True)
class FileMotion:
    """Loader of a motion file; `skeleton` names a known one where the listing does, `options` how it is to be read."""

    path: str
    skeleton: str = ""
    options: ReadingOptions | None = None

    def __call__(self, clip: Clip) -> tuple[Motion, Clip]:
        skeleton = Skeleton.named(self.skeleton) if self.skeleton else None
        motion, told = read_motion_with(self.path, self.options, fps=clip.fps, skeleton=skeleton)
        return motion, replace(clip, reading=told)


@dataclass(frozen=True)
class DemoMotion:
    """Loader of one clip of the demo grammar, generated from its index."""

    index: int
    seed: int
    fps: float

    def __call__(self, clip: Clip) -> tuple[Motion, Clip]:
        from motionary.corpus.demo import demo_clip

        motion, labels = demo_clip(self.index, self.seed, self.fps)
        texts = tuple(Caption(text, source="grammar") for text in labels["captions"])
        truth = json.dumps(labels["attributes"], sort_keys=True)
        labelled = replace(clip, style=labels["style"], action=labels["action"], captions=texts, attributes=truth)
        return motion, labelled


class FolderSource:
    """A folder with `clips.jsonl`, or any folder of .bvh, .amc, .npz and .npy files (then without captions, and without
    labels but for those that HumanAct12's names tell).

    Where the folder's rig is not known, its `mapping.json` says which joint plays which role, and how its files are to
    be read; a line of `clips.jsonl` may say it of one motion.

    Args:
        root: the folder.
        name: its name in clip ids and groups.
        fps: rate of arrays that no listing describes.
    """

    def __init__(self, root: Path, name: str, fps: float = 20.0):
        self.root, self.name, self.fps = root, name, fps
        self.options: ReadingOptions | None = None  # of its mapping.json, read with the clips
        self._unknown: tuple[set[str], set[str]] = (set(), set())  # keys of clips and of captions already complained of

    def clips(self) -> tuple[list[Clip], list[InputError]]:
        """See `Source`; ids are unique, a second line about the same motion is a problem."""
        mapping = self.root / MAPPING
        self.options = ReadingOptions.from_mapping(mapping) if mapping.is_file() else None
        self._unknown = (set(), set())
        listing = self.root / "clips.jsonl"
        if listing.is_file():
            found, problems = read_listing(listing, self._listed)
        else:
            found, problems = self._bare()
            problems += [InputError(path, "is not read", "must be called clips.jsonl") for path in self._misnamed()]
            if not found and not problems:
                raise InputError(self.root, "no motion", f"must hold clips.jsonl or {', '.join(MOTION_FILES)} files")
        unique: dict[str, Clip] = {}
        for clip in found:
            if clip.id in unique:
                problems.append(InputError(clip.where, clip.id, f"duplicate id, first seen at {unique[clip.id].where}"))
            else:
                unique[clip.id] = clip
        return sorted(unique.values(), key=lambda clip: clip.id), problems

    def _misnamed(self) -> list[Path]:
        """Files that somebody may have meant to be the listing."""
        return sorted(path for path in self.root.iterdir() if path.name.lower() in _NEARLY and path.is_file())

    def _listed(self, values: dict, where: str, problems: list[InputError]) -> Clip:
        relative = inside(self.root, values, where)
        skeleton = label(values, "skeleton", where)
        problems += unknown_keys(values, CLIP_KEYS, where, self._unknown[0])
        told = reading(self.root, values, where)
        options = told.over(self.options) if told else self.options
        return Clip(
            id=self._id(relative),
            load=FileMotion(str(self.root / relative), skeleton if skeleton in KNOWN_SKELETONS else "", options),
            where=where,
            group=self.name,
            fps=rate(values, relative, where),
            subject=label(values, "subject", where),
            style=label(values, "style", where),
            action=label(values, "action", where),
            captions=captions(values, where, problems, self._unknown[1]),
        )

    def _bare(self) -> tuple[list[Clip], list[InputError]]:
        """A clip for each motion file; a name or a link that cannot be used becomes a problem."""
        found, problems = [], []
        for path in motion_files(self.root):
            try:
                check_unicode(str(path), path)
                check_home(self.root, path, path)
                found.append(self._found(path))
            except InputError as problem:
                problems.append(problem)
        return self._one_format(found, problems), problems

    def _one_format(self, found: Sequence[Clip], problems: list[InputError]) -> list[Clip]:
        """One clip of files that differ by extension alone, the first by that; what is left out is one problem."""
        taken: dict[Path, Clip] = {}
        left: list[str] = []
        for clip in found:
            path = Path(clip.where)
            if taken.setdefault(path.with_suffix(""), clip) is not clip:
                left.append(path.suffix)
        if left:
            read = Counter(Path(clip.where).suffix for clip in taken.values())
            told = [", ".join(f"{n} {suffix}" for suffix, n in counts.items()) for counts in (Counter(left), read)]
            rule = f"left out: {told[0]}, which lie beside a file of the same name; read: {told[1]}"
            problems.append(InputError(self.root, f"{len(left)} of {len(found)} files", rule))
        return list(taken.values())

    def _found(self, path: Path) -> Clip:
        fps = self.fps if path.suffix.lower() in BARE_ARRAYS else None
        relative = PurePosixPath(path.relative_to(self.root).as_posix())
        load = FileMotion(str(path), options=self.options)
        return Clip(self._id(relative), load, str(path), self.name, fps, **labels_of(path)._asdict())

    def _id(self, relative: PurePosixPath) -> str:
        parts = relative.with_suffix("").parts
        # The usual subfolder says nothing; any other is part of the id, so that equal stems stay apart.
        return "/".join((self.name, *(parts[1:] if parts[0] == "motions" else parts)))


class DemoSource:
    """Clips of the procedural motion grammar, with captions, style and action."""

    name = "demo"

    def __init__(self, count: int, seed: int, fps: float):
        self.count, self.seed, self.fps = count, seed, fps

    def clips(self) -> tuple[list[Clip], list[InputError]]:
        """See `Source`; labels arrive with the motion."""
        return [
            Clip(f"demo/{i:06d}", DemoMotion(i, self.seed, self.fps), f"demo clip {i}", "demo")
            for i in range(self.count)
        ], []


def motion_files(root: Path) -> list[Path]:
    """Every motion file below a folder, sorted; hidden files and folders are left out."""
    found = [path for path in root.rglob("*") if path.suffix.lower() in MOTION_FILES and path.is_file()]
    return sorted(path for path in found if not any(p.startswith(".") for p in path.relative_to(root).parts))


def open_sources(config: DataConfig, base: str | Path = ".") -> list[Source]:
    """The sources of a configuration; relative roots start from `base`. A missing or empty root is an InputError."""
    if config.source == "demo":
        return [DemoSource(config.clips, config.seed, config.fps)]
    paths = [checked_root(Path(base) / root) for root in config.roots]
    names = root_names(paths)
    if config.source == "humanml3d":
        return [HumanML3DSource(path, name) for path, name in zip(paths, names, strict=True)]
    return [FolderSource(path, name, config.fps) for path, name in zip(paths, names, strict=True)]


def checked_root(path: Path) -> Path:
    """An existing folder with something in it."""
    if not path.is_dir():
        raise InputError(path, "missing" if not path.exists() else "a file", "data root must be an existing folder")
    if not any(path.iterdir()):
        raise InputError(path, "empty", "data root must hold motions")
    return path


def root_names(paths: Sequence[Path]) -> list[str]:
    """A short distinct name per root: the folder's name, with its parent's in front where two are called alike."""
    paths = [path.resolve() for path in paths]
    names = [check_unicode(path.name, "data.roots") for path in paths]
    return [
        name if names.count(name) == 1 else f"{path.parent.name}-{name}" if path.parent.name else f"{name}-{i}"
        for i, (path, name) in enumerate(zip(paths, names, strict=True))
    ]


def source_of(root: Path) -> HumanML3DSource | FolderSource:
    """The source of a folder by what lies in it: the released layout, or a folder of motions."""
    name = checked_root(root).resolve().name
    released = any((root / folder).is_dir() for folder in ("new_joints", "new_joint_vecs"))
    return (
        HumanML3DSource(root, name) if released and not (root / "clips.jsonl").is_file() else FolderSource(root, name)
    )


def inventory(root: str | Path, progress: bool = True, stock: Path | None = None) -> dict[str, Any]:
    """Takes stock of a data root: every file with its hash and bytes, motions with their seconds, and listing problems.

    Reads headers, not motions; `seconds` is None where a header does not tell (arrays that nothing lists).

    Args:
        root: the folder.
        progress: show a bar.
        stock: a file beside the project that remembers what was found, so that only changed files are read again.
    """
    root = checked_root(Path(root))
    source = source_of(root)
    clips, problems = source.clips()
    rates = {getattr(clip.load, "path", ""): clip.fps for clip in clips}
    strictly = isinstance(source, FolderSource)
    paths = sorted(path for path in root.rglob("*") if path.is_file() and belongs(root, path, strictly))
    known_files = Stock(stock)
    with ThreadPoolExecutor(4) as pool:
        work = pool.map(lambda path: known_files.describe(path, root, rates.get(str(path))), paths)
        files = list(tqdm(work, total=len(paths), desc=f"inventory {source.name}", unit="file", disable=not progress))
    known_files.keep()
    known = [file["seconds"] for file in files if file["seconds"] is not None]
    return {
        "root": source.name,
        "clips": len(clips),
        "captions": sum(len(clip.captions) for clip in clips),
        "minutes": round(sum(known) / 60, 3),
        "problem_count": len(problems),
        "problems": problem_rows(problems, f"{root}/"),
        "files": files,
    }
