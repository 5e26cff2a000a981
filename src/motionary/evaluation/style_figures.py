"""Pictures of stylization: the space of style codes (thesis Fig. 5.7), and one motion in many styles (Fig. 5.1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motionary.corpus.cells import StyleSplit
from motionary.corpus.store import Corpus
from motionary.evaluation.style_draws import pools
from motionary.motion import Motion

MOST = 8  # styles in the picture of one motion
_NAMES = {"supervised": "supervised: beside the label", "unsupervised": "unsupervised: without labels"}


def draw_codes(stylizer: Any, corpus: Corpus, split: StyleSplit, settings: Sequence[str], count: int, seed: int = 0):
    """Style codes of real motions in two dimensions by t-SNE, colored by style, a panel for each setting.

    Args:
        stylizer: offers ``style_codes(motions, setting, labels)`` and `receptive`.
        corpus: that holds the motions.
        split: whose scored styles are drawn.
        settings: trained ones.
        count: at most so many unmirrored motions, of all splits.
        seed: of the choice and of t-SNE.

    Returns:
        A matplotlib figure, or None where fewer than ten motions have a scored style.
    """
    from matplotlib.figure import Figure
    from sklearn.manifold import TSNE

    wanted = np.isin(corpus.style_ids, split.scored) & ~corpus.clips.mirrored
    rows = np.flatnonzero(wanted & (corpus.clips.length >= stylizer.receptive))
    rows = np.sort(np.random.default_rng(seed).permutation(rows)[:count])
    if len(rows) < 10:
        return None
    labels, motions = corpus.style_ids[rows], [corpus.features(i) for i in rows]
    figure = Figure(figsize=(5.5 * len(settings), 5))
    for place, setting in enumerate(settings, 1):
        codes = stylizer.style_codes(
            motions, setting=setting, labels=labels.tolist() if setting == "supervised" else None
        )
        perplexity = min(30.0, (len(rows) - 1) / 3)
        flat = TSNE(init="pca", perplexity=perplexity, random_state=seed).fit_transform(np.asarray(codes))
        axis = figure.add_subplot(1, len(settings), place)
        for color, style in enumerate(split.scored):
            here = labels == style
            axis.scatter(*flat[here].T, s=9, color=f"C{color % 10}", label=split.styles[style])
        axis.set_title(_NAMES.get(setting, setting), fontsize=10)
        axis.set_xticks([])
        axis.set_yticks([])
    axis.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
    figure.tight_layout()
    return figure


def many_styles(
    stylizer: Any, corpus: Corpus, split: StyleSplit, settings: Sequence[str], seed: int = 0
) -> tuple[list[Motion], list[str]]:
    """One test motion and what stylization makes of it, with captions: each scored style (without any: each known one)
    by its label, or by a reference where labels were not trained; else five draws of the prior."""
    row = _typical(corpus, next(iter(pools(corpus, split).values())))
    features = corpus.features(row)
    styles = list(split.scored or range(len(split.styles)))[:MOST]
    names = [split.styles[s] for s in styles]
    asked: dict[str, Any] = {"setting": "unsupervised"}
    if styles and "supervised" in settings:
        asked = {"setting": "supervised", "labels": styles}
    elif split.scored:
        known, long = np.concatenate([split.references, split.test]), corpus.clips.length >= stylizer.receptive
        references = [next(i for i in known if corpus.style_ids[i] == s and long[i]) for s in styles]
        asked["references"] = [corpus.features(i) for i in references]
    else:
        names = [f"draw {i + 1} of the prior" for i in range(5)]
    made = stylizer.stylize([features] * len(names), seeds=[seed + i for i in range(len(names))], **asked)
    codec, fps = corpus.context.make_codec(), corpus.context.fps
    own = ", ".join(part for part in (corpus.clips.style[row], corpus.clips.action[row]) if part)
    captions = [f"the motion itself ({own})" if own else "the motion itself", *names]
    return [codec.decode(np.asarray(f), fps=fps) for f in (features, *made)], captions


def _typical(corpus: Corpus, pool: np.ndarray) -> int:
    """A walking motion if there is one, else any; of those the one of median length."""
    walks = [i for i in pool if str(corpus.clips.action[i]).startswith("walk")]
    rows = np.asarray(walks or pool)
    return int(rows[np.argsort(corpus.clips.length[rows], kind="stable")[len(rows) // 2]])
