"""Scores of captions: BLEU, ROUGE-L, CIDEr and BERTScore (TM2T 4.2, as computed by nlg-eval).

Candidates and references are words joined by blanks, normalized or raw alike: nothing is tokenized here beyond
splitting at blanks, so compare normalized with normalized text. Each candidate has one or more references.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError

References = Sequence[Sequence[str]]


def bleu(candidates: Sequence[str], references: References, order: int = 4) -> tuple[float, ...]:
    """Corpus BLEU (Papineni et al. 2002) of 1 up to ``order`` words, in [0, 1].

    The brevity penalty takes the reference nearest in length; nothing is smoothed but zero counts, which count 1e-15.
    """
    from pycocoevalcap.bleu.bleu import Bleu

    texts, truths = _checked(candidates, references)
    scores, _ = Bleu(order).compute_score(truths, texts, verbose=0)
    return tuple(float(score) for score in scores)


def rouge_l(candidates: Sequence[str], references: References) -> float:
    """Mean ROUGE-L F-measure (Lin 2004, beta 1.2, the best precision and the best recall of the references)."""
    from pycocoevalcap.rouge.rouge import Rouge

    texts, truths = _checked(candidates, references)
    return float(Rouge().compute_score(truths, texts)[0])


def cider(candidates: Sequence[str], references: References) -> float:
    """CIDEr-D (Vedantam et al. 2015), in [0, 10]; document frequencies are those of the references given.

    With a single candidate every word occurs in each document, so that the score is 0.
    """
    from pycocoevalcap.cider.cider import Cider

    texts, truths = _checked(candidates, references)
    return float(Cider().compute_score(truths, texts)[0])


def bert_score(
    candidates: Sequence[str], references: References, model: str | Path | None = None, layer: int | None = None
) -> float:
    """Mean BERTScore F1 (Zhang et al. 2020), against the best of the references, not rescaled by a baseline.

    Args:
        candidates: N texts; a blank one scores 0.
        references: one or more for each.
        model: path or name of a locally stored Hugging Face encoder; by default the packaged language model.
        layer: the layer whose states are compared; by default the last.
    """
    from bert_score import BERTScorer
    from transformers.utils import logging

    from motionary.language.frozen import load_encoder, model_path

    texts, truths = _checked(candidates, references)
    path = model_path(model)
    layers = load_encoder(path)[1].config.num_hidden_layers
    if layer is not None and not 1 <= layer <= layers:
        raise InputError("layer", layer, f"must be from 1 to {layers}")
    rows = [index for index, [text] in texts.items() if text.strip()]
    if not rows:
        return 0.0
    logging.disable_progress_bar()
    try:
        scorer = BERTScorer(model_type=path, num_layers=layer or layers, device="cpu")
    finally:
        logging.enable_progress_bar()
    _, _, scores, *_ = scorer.score([texts[row][0] for row in rows], [truths[row] for row in rows])
    return float(np.asarray(scores).sum()) / len(texts)


def caption_scores(
    candidates: Sequence[str], references: References, bert: bool = True, model: str | Path | None = None
) -> dict[str, Any]:
    """All scores of captions at once.

    Returns:
        ``bleu1``, ``bleu4``, ``rouge_l`` in [0, 1], ``cider`` in [0, 10], and with ``bert`` also ``bert_score`` and
        ``bert_model``, the name of the model behind it.

    Raises:
        InputError: no candidates, not one list of references for each, or an empty list or a blank text among these.
    """
    by_order = bleu(candidates, references)
    scores: dict[str, Any] = {
        "bleu1": by_order[0],
        "bleu4": by_order[3],
        "rouge_l": rouge_l(candidates, references),
        "cider": cider(candidates, references),
    }
    if bert:
        from motionary.language.frozen import model_name

        scores["bert_score"] = bert_score(candidates, references, model)
        scores["bert_model"] = model_name(model)
    return scores


def _checked(candidates: Sequence[str], references: References) -> tuple[dict[int, list[str]], dict[int, list[str]]]:
    """Candidates and references as the scorers want them, with single blanks between words."""
    if len(candidates) == 0:
        raise InputError("candidates", "[]", "must not be empty")
    if len(candidates) != len(references):
        raise InputError("references", len(references), f"must be one list for each of {len(candidates)} candidates")
    texts, truths = {}, {}
    for index, (candidate, several) in enumerate(zip(candidates, references, strict=True)):
        if isinstance(several, str):
            raise InputError(f"references[{index}]", several, "must be a list of texts")
        truths[index] = [" ".join(text.split()) for text in several]
        if not truths[index] or not all(truths[index]):
            raise InputError(f"references[{index}]", list(several), "must hold at least one text and no blank one")
        texts[index] = [" ".join(candidate.split())]
    return texts, truths
