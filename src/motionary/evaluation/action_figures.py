"""Pictures of what labels can ask for: actions, transitions, outpainting, interpolation (thesis Fig. 3.8-3.14)."""

from __future__ import annotations

import numpy as np

from motionary.corpus.acted import Acted, ActionLabels
from motionary.corpus.store import Corpus
from motionary.motion import Motion
from motionary.systems.action_protocols import ActionToMotion

MOST = 6  # actions in the picture of actions

Rows = tuple[list[Motion], list[str]]  # motions, and a caption for each


def draw_uses(
    actor: ActionToMotion, corpus: Corpus, labels: ActionLabels, window: int, seed: int = 0
) -> dict[str, Rows]:
    """Motions and captions of each picture, by its name.

    "actions": one motion of each of the most frequent actions; "transitions": from one to the next; "outpainting": a
    real motion's first quarter gone on from in three ways; "interpolation": first latents from one seed to another.
    """
    common = np.bincount(labels.action[labels.action >= 0], minlength=len(labels.coarse)).argsort(kind="stable")[::-1]
    names = [labels.coarse[i] for i in common[:MOST] if labels.coarse[i] in actor.actions]
    if not names or actor.starts_from_pose(actor.variants[0]):
        return {}
    found: dict[str, Rows] = {}
    found["actions"] = actor.act([[(name, window)] for name in names], [seed] * len(names)), names
    pairs = list(zip(names, names[1:] + names[:1], strict=True))[:3] if len(names) > 1 else []
    if pairs:
        plans = [[(first, window // 2), (second, window // 2)] for first, second in pairs]
        found["transitions"] = actor.act(plans, [seed] * len(plans)), [f"{a}, then {b}" for a, b in pairs]
    rows = labels.rows(corpus, "test", mirrored=False)
    rows = rows[labels.action[rows] == labels.coarse.index(names[0])]
    if len(rows):
        real = Acted(corpus, labels, rows[:1], window, random=False).stretch(
            0, 0, min(window, int(corpus.clips.length[rows[0]]))
        )
        start = real[: max(1, len(real) // 4)]
        made = actor.act(
            [[(names[0], max(1, window - len(start)))]] * 3, [seed + k for k in range(3)], starts=[start] * 3
        )
        context = corpus.context
        captions = [f"{names[0]}, real", *(f"its first {len(start)} frames, gone on from: {k + 1}" for k in range(3))]
        found["outpainting"] = [Motion(real, context.fps, context.skeleton), *made], captions
    between = actor.between(names[0], window, (seed, seed + 1), 4)
    found["interpolation"] = between, [f"{names[0]}, {k} of 3 from one first latent to the other" for k in range(4)]
    return found
