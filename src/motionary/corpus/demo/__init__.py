"""The demo corpus: a motion grammar that writes captioned motion out of nothing but a seed.

`demo_clip(index, seed)` is a pure function, so that clips can be made in parallel and in any number.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from motionary.motion import Motion

__all__ = ["demo_clip", "demo_clips"]


def demo_clip(index: int, seed: int = 0, fps: float = 20.0) -> tuple[Motion, dict[str, Any]]:
    """One captioned clip of the demo corpus.

    Args:
        index: number of the clip, 0 or more; a clip does not depend on any other.
        seed: of the whole corpus, 0 or more.
        fps: frames per second wanted; the movement is the same at every rate.

    Returns:
        motion: 2-10 s on the skeleton smpl22, feet on the floor y = 0, at the origin and facing +z at the first
            frame, with true local rotations.
        truth: ``id`` ("demo_000123"), ``captions`` (3-4 sentences), ``style``, ``action`` (the label; of the first
            act where there are two) and ``attributes``: ``style``, ``together`` and ``acts``, a list of dicts with
            ``action`` and, where they mean something, ``side``, ``direction``, ``count``, ``speed``, ``angle``; the
            first act's attributes also stand at the top level.

    Raises:
        InputError: index or seed below 0, or fps not between 1 and 240.
    """
    from motionary.corpus.demo.clip import make

    return make(index, seed, fps)


def demo_clips(count: int, seed: int = 0, fps: float = 20.0) -> Iterator[tuple[Motion, dict[str, Any]]]:
    """Clips 0 to count - 1 of the demo corpus; see `demo_clip`."""
    for index in range(count):
        yield demo_clip(index, seed, fps)
