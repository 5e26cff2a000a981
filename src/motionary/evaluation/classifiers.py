"""What the style and content classifiers make of real motions, of combinations that they were not trained on."""

from __future__ import annotations

from typing import Any

import numpy as np

from motionary.corpus.cells import StyleSplit
from motionary.corpus.store import Corpus
from motionary.metrics.classification import accuracy, macro_accuracy
from motionary.systems.protocols import StyleClassifier


def judge_real(judge: StyleClassifier, corpus: Corpus, split: StyleSplit) -> dict[str, Any]:
    """Report of the classifiers on the real motions of the held-out cells.

    Returns:
        {"style", "content", "windows", "cells"}: style accuracy over the scored styles (macro), content accuracy
        over the actions (macro), and both of each cell; without labels only {"windows": 0}.
    """
    if not judge.trained or not len(split.test):
        return {"windows": 0}
    features = [corpus.features(i) for i in split.test]
    style, content = (call(features)[0].argmax(1) for call in (judge.style, judge.content))
    wanted_style, wanted_action = corpus.style_ids[split.test], corpus.action_ids[split.test]
    cells = {}
    for s, a in split.cells:
        here = np.flatnonzero((wanted_style == s) & (wanted_action == a))
        cells[f"{split.styles[s]}, {split.actions[a]}"] = {
            "windows": len(here),
            "style": round(accuracy(style[here], wanted_style[here]), 4),
            "content": round(accuracy(content[here], wanted_action[here]), 4),
        }
    return {
        "windows": len(features),
        "style": round(macro_accuracy(style, wanted_style, split.scored), 4),
        "content": round(macro_accuracy(content, wanted_action), 4),
        "cells": cells,
    }
