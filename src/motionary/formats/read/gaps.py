"""Frames without a body and joints without a place, as programs mark them: zeros, or all joints in one point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from motionary.errors import InputError

MOST_MISSING = 0.5  # of the frames, in which a joint has no place


def unseen(places: np.ndarray, roles: Mapping[str, int]) -> np.ndarray:
    """(T, J) whether a joint has no place, of places (T, J, 3) in any unit.

    All joints in one point are no body, and a joint of the body at exactly zero was not seen. A pelvis may lie there,
    between the hips: many files are moved so that it does. So may a rig's helpers, which play no role.

    Args:
        places: of the joints.
        roles: joint by role; without those of pelvis or hips only whole frames are looked at.
    """
    frames, joints, _ = places.shape
    if joints == 1:
        return np.zeros((frames, 1), bool)
    empty = np.all(places == places[:, :1], axis=(1, 2))
    if not {"left_hip", "right_hip"} <= roles.keys():
        return np.repeat(empty[:, None], joints, axis=1)
    zero = np.zeros((frames, joints), bool)
    body = list(roles.values())
    zero[:, body] = (places[:, body] == 0).all(-1)
    if "pelvis" in roles and (there := np.flatnonzero(zero[:, roles["pelvis"]])).size:
        left, right = (places[there, roles[f"{side}_hip"]].astype(np.float64) for side in ("left", "right"))
        centred = np.linalg.norm((left + right) / 2, axis=-1) < np.linalg.norm(left - right, axis=-1)
        often = centred.mean() > MOST_MISSING  # then it is so in all of them, however the body is bent
        zero[there if often else there[centred], roles["pelvis"]] = False
    return zero | empty[:, None]


def filled(
    what: object, places: np.ndarray, gone: np.ndarray, names: Sequence[str]
) -> tuple[slice, np.ndarray, list[str]]:
    """The frames from the first to the last that have every joint, and gaps between on straight lines.

    Args:
        what: the file, for errors.
        places: (T, J, 3).
        gone: (T, J) where a joint has no place.
        names: of the joints.

    Returns:
        Which frames these are, their places, and what was left out and filled.

    Raises:
        InputError: a joint is missing in most frames, or one of them in each.
    """
    held = np.flatnonzero(~gone.all(1))
    span = gone[held[0] : held[-1] + 1] if len(held) else gone
    for joint, name in enumerate(names):
        if len(span) and (share := float(span[:, joint].mean())) > MOST_MISSING:
            rule = f"a joint must have a place in {1 - MOST_MISSING:.0%} of the frames"
            raise InputError(f"{what}, {name}", f"missing in {share:.0%}", rule)
    whole = np.flatnonzero(~gone.any(1))
    if len(whole) == 0:
        raise InputError(what, f"{len(places)} frames", "must have one in which every joint has a place")
    kept = slice(int(whole[0]), int(whole[-1]) + 1)
    notes = _left_out(gone, kept)
    places, gone = places[kept].copy(), gone[kept]
    time, empty = np.arange(len(places)), np.all(gone, axis=1)
    for joint in map(int, np.flatnonzero(np.any(gone, axis=0))):
        off = gone[:, joint]
        for axis in range(3):
            places[off, joint, axis] = np.interp(time[off], time[~off], places[~off, joint, axis])
    counts = (gone & ~empty[:, None]).sum(0)
    if gaps := [f"{name} in {count}" for name, count in zip(names, counts, strict=True) if count]:
        notes.append(f"without a place, filled on straight lines: {', '.join(gaps)} of {len(places)} frames")
    if empty.any():
        notes.append(f"{empty.sum()} of {len(places)} frames hold no body, and were filled on straight lines")
    return kept, places, notes


def _left_out(gone: np.ndarray, kept: slice) -> list[str]:
    """What to say of frames at both ends that were not kept, of those (T, J) in which joints have no place."""
    ends = {"first": gone[: kept.start], "last": gone[kept.stop :]}
    parts = [f"the {name} {len(end)}" for name, end in ends.items() if len(end)]
    if not parts:
        return []
    how = "hold no body" if all(end.all() for end in ends.values()) else "lack joints"
    return [f"{' and '.join(parts)} frames {how} and were left out"]
