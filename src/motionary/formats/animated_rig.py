"""An animated rig as a file gives it: local rotations, and translations of the joints that have some."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motionary.motion.rotations import quat_action, quat_product

_FRAMES = 1024  # of a long take are worked on at a time: memory for these, and arrays that fit into caches


@dataclass(frozen=True)
class Track:
    """An animated rig in the file's own unit and axes. `to_motion` overwrites its arrays, to save memory.

    Attributes:
        joints: (J,) names, parents before children.
        parents: (J,) indices, -1 for the root.
        rotations: (T, J, 4) float32 local unit quaternions xyzw.
        offsets: (J, 3) translation of each joint from its parent, in the parent's frame, where it does not move.
        moves: (T, 3) by joint, the translations of those that move; the root's is global.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    rotations: np.ndarray
    offsets: np.ndarray
    moves: Mapping[int, np.ndarray]

    def place(self) -> np.ndarray:
        """Global positions (T, J, 3) float32."""
        positions = np.empty((*self.rotations.shape[:2], 3), np.float32)
        for some in stretches(len(positions)):
            translations = np.repeat(self.offsets[None], len(positions[some]), axis=0)
            for joint, moves in self.moves.items():
                translations[:, joint] = moves[some]
            positions[some], _ = place(self.parents, self.rotations[some], translations)
        return positions

    @property
    def rest(self) -> np.ndarray:
        """(J, 3) rest offsets: the median translation over time; zero for the root."""
        rest = self.offsets.copy()
        for joint, moves in self.moves.items():
            rest[joint] = np.median(moves, axis=0)
        rest[0] = 0
        return rest

    def without_root(self) -> Track:
        """The same without its root, whose only child, joint 1, becomes the root; the arrays are used up."""
        moves = {joint: np.broadcast_to(self.offsets[joint], (len(self.rotations), 3)) for joint in (0, 1)}
        moves |= self.moves
        root = self.rotations[:, 0].astype(np.float64)
        moved = moves[0] + quat_action(root, moves[1])
        self.rotations[:, 1] = quat_product(root, self.rotations[:, 1])
        later = {joint - 1: places for joint, places in moves.items() if joint > 1}
        rotations = kept(self.rotations, range(1, len(self.joints)))
        return Track(
            self.joints[1:], tuple(p - 1 for p in self.parents[1:]), rotations, self.offsets[1:], {0: moved} | later
        )


def place(parents: Sequence[int], rotations: np.ndarray, translations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Global positions (T, J, 3) and rotations (T, J, 4), float64, of local ones.

    Args:
        parents: (J,) indices, parents before children.
        rotations: (T, J, 4) unit quaternions xyzw.
        translations: (T, J, 3) from the parent, in its frame; the root's is global.
    """
    # Components first: arithmetic runs along time, in one piece of memory.
    turned = rotations.transpose(1, 2, 0).astype(np.float64, order="C")
    placed = translations.transpose(1, 2, 0).astype(np.float64, order="C")
    for j, p in enumerate(parents[1:], 1):
        placed[j] = placed[p] + quat_action(turned[p], placed[j], axis=0)
        turned[j] = quat_product(turned[p], turned[j], axis=0)
    return placed.transpose(2, 0, 1), turned.transpose(2, 0, 1)


def stretches(frames: int) -> Iterator[slice]:
    """Slices of so many frames as are worked on at a time."""
    return (slice(start, start + _FRAMES) for start in range(0, frames, _FRAMES))


def kept(array: np.ndarray, joints: Sequence[int]) -> np.ndarray:
    """The array (T, J, n) with these joints alone, in this order, in the memory of the old one, which it uses up."""
    frames, _, width = array.shape
    flat, row = array.reshape(-1), len(joints) * width
    for some in stretches(frames):
        part = array[some][:, list(joints)]  # a copy
        flat[some.start * row : some.start * row + part.size] = part.reshape(-1)
    return flat[: frames * row].reshape(frames, len(joints), width)


def unique_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names, with a number where a file uses one twice."""
    seen: dict[str, int] = {}
    taken = set(names)
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        label = name
        while seen[name] > 1 and label in taken:
            label = f"{name}_{seen[name]}"
            seen[name] += label in taken
        taken.add(label)
        result.append(label)
    return tuple(result)
