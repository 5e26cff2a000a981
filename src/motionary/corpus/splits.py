"""Who trains and who is tested: splits by clip, by subject, or by held-out style-action combinations."""

from __future__ import annotations

import hashlib
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from motionary.errors import InputError, is_real

if TYPE_CHECKING:  # at run time whatever opens a corpus would load how files are read
    from motionary.corpus.clips import Clip

SPLITS = ("train", "val", "test")
KINDS = ("clip", "subject", "combination", "given")


def split_clips(clips: Sequence[Clip], kind: str, ratios: Sequence[float], seed: int) -> dict[str, str]:
    """Clip id -> "train", "val" or "test".

    The same set of clips gets the same splits in whatever order it comes; a clip and its source's mirrored copy
    (equal `origin`) stay together.

    Args:
        kind: what is never shared between splits.
            "clip": single clips. Each split gets its share of every root, caption source, style and action.
            "subject": people. All clips of a subject are in one split; a clip without a subject stands for itself.
            "combination": pairs of a style and an action. Validation and test get whole pairs that training never
            sees, while the style and the action each stay in training with other partners. Clips that lack either
            label are split as by "clip".
            "given": the split that the source itself names; clips without one are split as by "clip".
        ratios: shares of train, val and test.
        seed: another seed draws another split.

    Raises:
        InputError: ratios that are no shares, "combination" without clips that have both labels, "given" without any
            given split, or a kind that leaves nothing to test.
    """
    check_shares("ratios", ratios)
    chosen = {"clip": _by_clip, "subject": _by_subject, "combination": _by_combination, "given": _given}[kind]
    origins: dict[str, list[Clip]] = defaultdict(list)
    for clip in clips:
        origins[clip.origin].append(clip)
    firsts = [min(members, key=lambda clip: (clip.mirrored, clip.id)) for members in origins.values()]
    splits = chosen(firsts, ratios, seed)
    result = {clip.id: splits[clip.origin] for clip in clips}
    if kind == "given":
        result |= {clip.id: clip.split for clip in clips if clip.split}
    if kind in ("subject", "combination") and ratios[2] and "test" not in result.values():
        raise InputError("data.split", kind, "leaves no test clips: there are too few subjects or combinations")
    return result


def check_shares(what: str, ratios: Sequence[float]) -> None:
    """InputError that names `what` where shares of train, val and test are none."""
    good = len(ratios) == 3 and all(is_real(share) and 0 <= share <= 1 for share in ratios)
    if not good or not math.isclose(sum(ratios), 1, abs_tol=1e-6) or ratios[0] <= 0:
        rule = "must be three shares (train, val, test) from 0 to 1 that sum to 1, train above 0"
        raise InputError(what, list(ratios), rule)


def _by_clip(clips: Sequence[Clip], ratios: Sequence[float], seed: int) -> dict[str, str]:
    """Deals the sorted clips out one by one, each to the split that lacks most of its share so far."""

    def stratum(clip: Clip) -> tuple:
        """Sorts clips of one kind next to each other, so that splits dealt out along the row share every kind."""
        sources = sorted({caption.source for caption in clip.captions})
        return clip.group, sources, _hash(seed, f"{clip.style}/{clip.action}"), _hash(seed, clip.origin)

    counts = Counter[str]()
    splits = {}
    for n, clip in enumerate(sorted(clips, key=stratum), 1):
        splits[clip.origin] = _neediest(counts, ratios, n)
        counts[splits[clip.origin]] += 1
    return splits


def _by_subject(clips: Sequence[Clip], ratios: Sequence[float], seed: int) -> dict[str, str]:
    return _whole(clips, lambda clip: f"{clip.group}/{clip.subject}" if clip.subject else clip.origin, ratios, seed)


def _by_combination(clips: Sequence[Clip], ratios: Sequence[float], seed: int) -> dict[str, str]:
    labelled = [clip for clip in clips if clip.style and clip.action]
    if not labelled:
        raise InputError("data.split", "combination", "needs clips with both a style and an action label")
    cells = Counter((clip.style, clip.action) for clip in labelled)
    styles, actions = Counter(style for style, _ in cells), Counter(action for _, action in cells)
    wanted, held = {"test": ratios[2] * len(labelled), "val": ratios[1] * len(labelled)}, {}
    for cell in sorted(cells, key=lambda cell: _hash(seed, "/".join(cell))):
        style, action = cell
        name = next((name for name in wanted if cells[cell] <= wanted[name] + cells[cell] / 2), None)
        # Only a combination is held out: its style and its action must each stay in training elsewhere.
        if name and styles[style] > 1 and actions[action] > 1:
            held[cell] = name
            wanted[name] -= cells[cell]
            styles[style] -= 1
            actions[action] -= 1
    splits = _by_clip([clip for clip in clips if not (clip.style and clip.action)], ratios, seed)
    return splits | {clip.origin: held.get((clip.style, clip.action), "train") for clip in labelled}


def _given(clips: Sequence[Clip], ratios: Sequence[float], seed: int) -> dict[str, str]:
    if not any(clip.split for clip in clips):
        raise InputError("data.split", "given", "no clip has a split: the source brings no split files")
    splits = {clip.origin: clip.split for clip in clips if clip.split}
    return splits | _by_clip([clip for clip in clips if not clip.split], ratios, seed)


def _whole(clips: Sequence[Clip], unit: Callable[[Clip], str], ratios: Sequence[float], seed: int) -> dict[str, str]:
    """Whole units to the split that lacks most, the largest units first."""
    units: dict[str, list[Clip]] = defaultdict(list)
    for clip in clips:
        units[unit(clip)].append(clip)
    counts = Counter[str]()
    splits = {}
    for name in sorted(units, key=lambda name: (-len(units[name]), _hash(seed, name))):
        chosen = _neediest(counts, ratios, len(clips))
        counts[chosen] += len(units[name])
        splits |= {clip.origin: chosen for clip in units[name]}
    return splits


def _neediest(counts: Counter, ratios: Sequence[float], total: int) -> str:
    return max(SPLITS, key=lambda split: ratios[SPLITS.index(split)] * total - counts[split])


def _hash(seed: int, name: str) -> str:
    return hashlib.sha256(f"{seed}:{name}".encode()).hexdigest()
