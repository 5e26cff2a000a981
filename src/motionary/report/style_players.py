"""One motion and the same in several styles, for a player of the page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from motionary.corpus.encoding import as_motion
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.motion import Motion
from motionary.systems.io import open_system
from motionary.systems.protocols import MotionStylizer
from motionary.systems.registry import STYLIZE, offering

_MOST = 4  # styles that are shown


def make_styled(corpus: Corpus, models: Path, seed: int = 0, device: str = "cpu") -> list[tuple[str, Motion]]:
    """A test motion and what stylization makes of it, each with a name; empty where nothing stylizes."""
    here = [name for name in offering(STYLIZE) if (models / name).is_dir()]
    row = _typical(corpus)
    if not here or row is None:
        return []
    stylizer: MotionStylizer = open_system(here[0], STYLIZE, models, device)
    labels = [int(k) for k in np.unique(np.linspace(0, len(stylizer.styles) - 1, _MOST).astype(int))]
    try:
        stylizer.model("supervised")
        names = [stylizer.styles[label] for label in labels]
        asked: dict[str, Any] = {"setting": "supervised", "labels": labels}
    except InputError:  # trained without labels: drawn styles
        names = [f"by chance, {k + 1}" for k in range(_MOST)]
        asked = {"setting": "unsupervised"}
    content = np.array(corpus.features(row))
    made = stylizer.stylize([content] * len(names), seeds=[seed + k for k in range(len(names))], **asked)
    own = str(corpus.clips.style[row]) or "the motion itself"
    return [(own, as_motion(content, corpus.context))] + [
        (name, as_motion(motion, stylizer.context)) for name, motion in zip(names, made, strict=True)
    ]


def _typical(corpus: Corpus) -> int | None:
    """A walk of the test split if there is one, else any of its motions; the one of median length."""
    clips = corpus.clips
    test = np.flatnonzero((clips.split == "test") & ~clips.mirrored)
    walks = [row for row in test if str(clips.action[row]).startswith("walk")]
    rows = np.asarray(walks or test, int)
    return int(rows[np.argsort(clips.length[rows], kind="stable")[len(rows) // 2]]) if len(rows) else None
