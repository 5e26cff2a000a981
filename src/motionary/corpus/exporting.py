"""Any folder of motion as the HumanML3D release is laid out, for code that reads nothing else."""

from __future__ import annotations

import csv
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from motionary.corpus.clips import Caption, Clip
from motionary.corpus.config import COVERING, RELEASED
from motionary.corpus.released import RELEASES, HumanML3DSource
from motionary.corpus.sources import source_of
from motionary.corpus.splits import SPLITS, check_shares, split_clips
from motionary.corpus.windows import Rule, Window
from motionary.corpus.workers import Encoded, Recipe, encode_clip, in_order
from motionary.corpus.writing import RunningStatistics, group_means
from motionary.errors import KEPT, InputError, check_whole
from motionary.features import UNIT, HumanML3D
from motionary.files import atomic_folder, save_array
from motionary.language import mirror_text, tagged_tokens
from motionary.motion import Skeleton

SECONDS = (2.0, 10.0)  # the released loaders pass over motions below 40 and from 200 frames on
_SKELETON, _FPS = RELEASES[22]
_INDEX = ("new_name", "source_path", "start_frame", "end_frame", "split")


def export_humanml3d(
    root: str | Path,
    out: str | Path,
    *,
    split: str = "clip",
    ratios: Sequence[float] = (0.8, 0.05, 0.15),
    seed: int = 0,
    mirror: bool = True,
    workers: int = 0,
    force: bool = False,
    progress: bool = True,
) -> dict[str, Any]:
    """Write a folder of motion in the layout of HumanML3D's release.

    Clips are read, cut and encoded as `preprocess` does it, at 20 fps on 22 joints. A window of 2 to 10 s becomes
    `new_joints/<name>.npy` (T, 22, 3) and `new_joint_vecs/<name>.npy` (T, 263), both float32 and T a multiple of 4,
    and `texts/<name>.txt` with a line `caption#word/POS word/POS#0.0#0.0` for each caption. `M<name>` is its mirrored
    copy, of the same split. `train.txt`, `val.txt`, `test.txt` and `all.txt` list the names, `index.csv` says which
    frames (at 20 fps) of which file each is. `Mean.npy` and `Std.npy` are over the frames of all files, the deviation
    averaged within each group of features; as in the release, the root's and the contacts' are not divided by 5, which
    its training code does.

    Args:
        root: a folder of motion, with or without `clips.jsonl`, or one that is in the released layout already.
        out: the new folder; it appears whole or not at all.
        split: kind of split, see `split_clips`; splits that the folder itself gives are kept.
        ratios: shares of train, val and test.
        seed: of the split.
        mirror: add mirrored copies.
        workers: processes; 0 is one for each core.
        force: replace an existing folder.
        progress: show bars.

    Returns:
        Counts: "clips", "motions" and "captions" (copies included), a number for each split, "split", by what they
        were split ("given": by the folder itself), and "problems", a list of InputError.

    Raises:
        InputError: no usable clip, or a place that cannot be written.
    """
    root = Path(root)
    check_shares("ratios", ratios)
    check_whole("seed", seed, 0)
    source = source_of(root)
    clips, problems = source.clips()
    if not clips:
        hint = f"; the first problem: {problems[0]}" if problems else ""
        raise InputError(root, "no clip", f"must hold at least one usable clip{hint}")
    kind = "given" if any(clip.split for clip in clips) else split
    splits = split_clips(clips, kind, ratios, seed)
    cut = RELEASED if isinstance(source, HumanML3DSource) else COVERING
    out = _free(root, Path(out), force)
    recipe = Recipe(_SKELETON, "humanml3d", Rule(_FPS, *SECONDS, UNIT, cut, seed=seed), mirror)
    # Copies are made of training clips: here every split gets them, as in the release.
    encoded = in_order(encode_clip, [(clip, "train", recipe) for clip in clips], workers or os.cpu_count() or 1)
    with atomic_folder(out) as folder:
        writing = _Writing(folder, root, problems)
        bar = tqdm(encoded, "export", len(clips), unit="clip", disable=not progress)
        for clip, found in zip(clips, bar, strict=True):
            writing.add(found, splits[clip.id])
        return {"clips": len(clips), "split": kind, **writing.finish()}


def _free(root: Path, out: Path, force: bool) -> Path:
    """The place of the new folder, where nothing is or `force` replaces it, and never the folder that is read."""
    if root.resolve().is_relative_to(out.resolve()):
        raise InputError(out, "holds the motions", "must be another folder than the one that is read")
    if out.is_dir() and any(out.iterdir()) and not force:
        raise InputError(out, "exists", KEPT)
    return out


@dataclass
class _Writing:
    """A released folder while it is being written."""

    folder: Path
    root: Path
    problems: list[InputError]
    rows: list[tuple[str, str, int, int, str]] = field(default_factory=list)
    said: list[tuple[str, Caption, str]] = field(default_factory=list)  # name, caption, its text
    numbers: dict[tuple[str, int], int] = field(default_factory=dict)

    def __post_init__(self):
        self.codec = HumanML3D(Skeleton.named(_SKELETON))
        self.statistics = RunningStatistics(self.codec.dim)
        for name in ("new_joints", "new_joint_vecs", "texts"):
            (self.folder / name).mkdir()

    def add(self, encoded: Encoded, split: str) -> None:
        """Write the arrays of one clip's windows, and keep what is said of them."""
        self.problems += encoded.problems
        clip = encoded.clip
        for k, (window, features, flipped) in enumerate(encoded.windows):
            number = self.numbers.setdefault((clip.origin, k), len(self.numbers))
            self._write(f"{'M' * clip.mirrored}{number:06d}", clip, window, features, split)
            if flipped is not None:
                self._write(f"M{number:06d}", clip, window, flipped, split, copy=True)

    def _write(
        self, name: str, clip: Clip, window: Window, features: np.ndarray, split: str, copy: bool = False
    ) -> None:
        save_array(self.folder / "new_joint_vecs" / f"{name}.npy", features)
        save_array(self.folder / "new_joints" / f"{name}.npy", self.codec.decode(features, fps=_FPS).positions)
        self.statistics.update(features)
        path = os.path.relpath(getattr(clip.load, "path", clip.where), self.root)
        self.rows.append((name, path, window.first, window.first + window.length, split))
        self.said += [(name, each, mirror_text(each.text) if copy else each.text) for each in window.captions]

    def finish(self) -> dict[str, Any]:
        """Write texts, splits, index and statistics; returns the counts."""
        if not self.rows:
            hint = f"; the first problem: {self.problems[0]}" if self.problems else ""
            raise InputError(self.root, "no usable clip", f"one of {SECONDS[0]:g} s at least must remain{hint}")
        lines: dict[str, list[str]] = {name: [] for name, *_ in self.rows}
        for (name, caption, text), tokens in zip(
            self.said, tagged_tokens([text for *_, text in self.said]), strict=True
        ):
            tokens = caption.tokens if caption.tokens and text == caption.text else tokens
            if tokens:
                lines[name].append(f"{text}#{' '.join(tokens)}#0.0#0.0")
            else:
                self.problems.append(InputError(caption.source or "caption", text, "has no word left"))
        for name, own in lines.items():  # an empty text: a motion that only tokenizers and autoencoders read
            _write_lines(self.folder / "texts" / f"{name}.txt", own)
        for split in SPLITS:
            _write_lines(self.folder / f"{split}.txt", [row[0] for row in self.rows if row[-1] == split])
        _write_lines(self.folder / "all.txt", list(lines))
        with (self.folder / "index.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([_INDEX, *self.rows])
        save_array(self.folder / "Mean.npy", self.statistics.mean.astype(np.float32))
        save_array(self.folder / "Std.npy", group_means(self.statistics.deviation(), self.codec.slices))
        counts = Counter(row[-1] for row in self.rows)
        told = {split: counts[split] for split in SPLITS} | {"problems": self.problems}
        return {"motions": len(self.rows), "captions": sum(map(len, lines.values())), **told}


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
