"""Which clips are broken, and why: limits on the measures of a clip, and what stands out in its folder.

The limits were set between real clips (CMU, Bandai-Namco) and the same with faults planted, on other clips than those
that `make flags` counts.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

UNREADABLE, T_POSE, IDLE, JITTER, FLIP, JUMP = "unreadable", "t-pose", "idle", "jitter", "flip", "jump"
SLIDING, SCALE, AXES = "sliding", "scale", "axes"
FLAGS = (UNREADABLE, T_POSE, IDLE, JITTER, FLIP, JUMP, SLIDING, SCALE, AXES)

_SMALLEST, _LARGEST = 0.75, 1.62  # m of leg and trunk: a child of about five, a man of 2.1 m
_OTHER_SIZE, _COMPANY = 0.15, 0.05  # departure from the folder's usual size; share of clips that makes it usual too
_USUAL_AXES = 0.9  # share of the files of one kind that makes the axes and unit of the others odd
_STILL = re.compile(
    r"\b(stand|stay|still|wait|idl|pos(e|es|ing)\b|paus|sit|lie|lying|lay|sleep|rest|balanc|motionless|freez|frozen|hold"
    r"|kneel|meditat|listen|look|stare|think)",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Told:
    """What is known of a clip: its kind of file, how it was read or why not, what is said of it, its measures."""

    kind: str
    up: str
    unit: float
    said: tuple[str, ...]
    problem: str
    measures: Mapping[str, float]


def flags(clips: Sequence[Told]) -> list[dict[str, str]]:
    """For each clip of a folder, why it is suspected, by flag; empty for a sound one."""
    sizes = np.array([clip.measures.get("size", np.nan) for clip in clips])
    usual = Counter((clip.kind, clip.up, _rounded(clip.unit)) for clip in clips if not clip.problem)
    kinds = Counter(clip.kind for clip in clips if not clip.problem)
    odd = {key for key, count in usual.items() if count < (1 - _USUAL_AXES) * kinds[key[0]]}
    found = []
    for clip, size in zip(clips, sizes, strict=True):
        if clip.problem and not clip.measures:
            found.append({UNREADABLE: clip.problem})
            continue
        own = dict(_own(clip))
        if (clip.kind, clip.up, _rounded(clip.unit)) in odd:
            own[AXES] = f"read as {clip.up} up, {clip.unit:.4g} m a unit, unlike the other {clip.kind} files"
        if reason := _size(size, sizes):
            own[SCALE] = reason
        found.append(own | ({UNREADABLE: clip.problem} if clip.problem else {}))
    return found


def _own(clip: Told) -> Iterator[tuple[str, str]]:
    """What a clip shows by itself."""
    is_ = clip.measures
    if is_["arms_out"] > 0.8 and is_["pose"] < 0.25:
        yield T_POSE, f"arms out in {is_['arms_out']:.0%} of the frames, and the pose hardly changes"
    if is_["pose"] < 0.03 or (is_["reach"] < 0.15 and not any(map(_STILL.search, clip.said))):
        yield IDLE, f"no joint moves more than {100 * min(is_['reach'], is_['pose']):.0f} cm"
    if "slide" not in is_:
        return
    noise, roughness = is_["noise"], is_["roughness"]  # who runs fast is noisy, but not rough
    if (noise > 0.0095 and roughness > 0.32) or (noise > 0.004 and roughness > 0.45):
        yield JITTER, f"joints tremble by {1000 * is_['noise']:.0f} mm from frame to frame"
    if is_.get("turn", 0) > 75:
        yield FLIP, f"turns {is_['turn']:.0f} degrees at once at {is_['turn_at']:.2f} s"
    if is_.get("jump", 0) > 0.2:
        yield JUMP, f"the pelvis jumps {is_['jump']:.2f} m at {is_['jump_at']:.2f} s"
    elif is_["bone_jump"] > 0.12 or (is_.get("spike", 0) > 0.5 and is_["spikiness"] > 15):
        yield JUMP, f"a joint jumps {max(is_['spike'], is_['bone_jump']):.2f} m at {is_['spike_at']:.2f} s"
    if is_["slide"] > 0.18 + 0.18 * max(0.0, is_["pace"] - 1):
        yield SLIDING, f"no foot stands: the stillest joint slides at {is_['slide']:.2f} m/s"


def _size(size: float, sizes: np.ndarray) -> str:
    """Why a body's size (m) is odd: no person has it, or hardly another clip of the folder; "" where it is not odd."""
    if not np.isfinite(size):
        return ""
    if not _SMALLEST < size < _LARGEST:
        return f"leg and trunk measure {size:.2f} m; people's {_SMALLEST:g} to {_LARGEST:g} m"
    known = sizes[np.isfinite(sizes)]
    usual = float(np.median(known))
    company = (np.abs(known / size - 1) < _COMPANY).mean()
    if len(known) >= 10 and abs(size / usual - 1) > _OTHER_SIZE and company < _COMPANY:
        return f"leg and trunk measure {size:.2f} m, those of the folder usually {usual:.2f} m"
    return ""


def _rounded(unit: float) -> float:
    return float(f"{unit:.3g}")
