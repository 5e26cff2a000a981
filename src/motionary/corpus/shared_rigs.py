"""Files of a folder that share a rig came from one program: what some of them show tells how all are to be read.

A clip that tells little by itself (someone who lies still, a pose) is read as its neighbors are; one that contradicts
them on strong evidence stays as it is, since the others count for no more than `_MOST`.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from motionary.corpus.clips import Clip
from motionary.corpus.sources import FileMotion
from motionary.corpus.workers import in_order
from motionary.formats.read.numpy_files import npy_shape
from motionary.formats.read.reading_options import ReadingOptions

FEWEST = 3  # files of a rig from which on they count
_READ = 8  # files of a rig that are looked at, spread over all
_MOST = 5.0  # log-odds at most: about one file in 150 is of another program
_MUCH = 3.0  # log-odds by which a file is sure of itself: 95% against one other value
_AGREE = 0.8  # share of those files that must agree
_HEADER = 1 << 20  # bytes of a BVH among which its hierarchy is looked for
_JOINT = re.compile(rb"^\s*(?:ROOT|JOINT)\s+(.+?)\s*$", re.MULTILINE)

Seen = Mapping[str, Mapping[str, float]]  # log-odds by option and value, 0 for the best


def with_shared_rigs(clips: Sequence[Clip], workers: int = 1) -> list[Clip]:
    """The clips, those of files told what others of their rig show; a few files of each rig are read for it.

    Args:
        clips: of any sources; what is no file of a folder stays as it is.
        workers: processes.
    """
    rigs: defaultdict[str, list[int]] = defaultdict(list)
    for i, clip in enumerate(clips):
        if isinstance(clip.load, FileMotion) and (rig := _rig(clip)):
            rigs[rig].append(i)
    rigs = defaultdict(list, {rig: members for rig, members in rigs.items() if len(members) >= FEWEST})
    chosen = [i for members in rigs.values() for i in _spread(members)]
    seen = dict(zip(chosen, in_order(_seen, [(clips[i],) for i in chosen], workers), strict=True))
    result = list(clips)
    for members in rigs.values():
        looked_at = {i: found for i in members if (found := seen.get(i))}
        for i in members:
            others = [found for k, found in looked_at.items() if k != i]
            if len(others) >= FEWEST - 1:
                result[i] = _told(clips[i], pooled(others))
    return result


def pooled(seen: Sequence[Seen]) -> dict[str, dict[str, float]]:
    """What several files show together: sums of log-odds, 0 for the best and -`_MOST` at least; whole numbers, so that
    one more file seldom changes them. Options of which those that tell much do not agree are left out: the folder mixes
    axes or units."""
    sums: defaultdict[str, defaultdict[str, float]] = defaultdict(lambda: defaultdict(float))
    verdicts: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for file in seen:
        for option, scores in file.items():
            for value, score in scores.items():
                sums[option][value] += score
            best, second = sorted(scores, key=lambda value: -scores[value])[:2]
            verdicts[option][best] += scores[best] - scores[second] > _MUCH
    return {
        option: {value: max(float(round(score - max(scores.values()))), -_MOST) for value, score in scores.items()}
        for option, scores in sums.items()
        if max(verdicts[option].values()) >= _AGREE * verdicts[option].total()
    }


def _rig(clip: Clip) -> str:
    """What files of one program and rig have in common: the folder, the kind, and the joints' names or number; "" where
    it cannot be told."""
    path = Path(clip.load.path)  # type: ignore[attr-defined]
    kind = path.suffix.lower()
    try:
        if kind == ".bvh":
            with path.open("rb") as file:
                header = file.read(_HEADER).split(b"MOTION", 1)[0]
            told = hashlib.sha256(b"\n".join(_JOINT.findall(header))).hexdigest()
        else:
            told = str(npy_shape(path)[1:]) if kind == ".npy" else ""
    except Exception:  # what is wrong with it is said when it is read
        return ""
    return f"{clip.group} {kind} {told}"


def _spread(members: Sequence[int]) -> list[int]:
    """A few of them, evenly."""
    count = min(_READ, len(members))
    return [members[i * len(members) // count] for i in range(count)]


def _seen(clip: Clip) -> Seen | None:
    """What the evidence of one file alone says; None where it cannot be read, which is said later."""
    try:
        reading = clip.load(clip)[1].reading
    except Exception:
        return None
    return reading.seen if reading is not None and reading.seen else None


def _told(clip: Clip, usual: dict[str, dict[str, float]]) -> Clip:
    load: Any = clip.load
    return replace(
        clip, load=replace(load, options=(load.options or ReadingOptions()).over(ReadingOptions(usual=usual)))
    )
