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
from motionary.metrics.intervals import Interval, interval

References = Sequence[Sequence[str]]


def bleu(candidates: Sequence[str], references: References, order: int = 4) -> tuple[float, ...]:
    """Corpus BLEU (Papineni et al. 2002) of 1 up to ``order`` words, in [0, 1].

    The brevity penalty takes the reference nearest in length; nothing is smoothed but zero counts, which count 1e-15.
    """
    return tuple(map(float, _bleu_scorer(candidates, references, order).compute_score("closest")[0]))


def bleu_interval(
    candidates: Sequence[str],
    references: References,
    order: int = 4,
    draws: int = 1000,
    generator: np.random.Generator | None = None,
) -> tuple[Interval, ...]:
    """`bleu` with 1.96 standard deviations of its bootstrap over captions (Koehn 2004).

    Args:
        candidates: N captions.
        references: one or more for each.
        order: longest run of words.
        draws: resamples of N captions each.
        generator: draws them; seed 0 where None.
    """
    if draws < 2:
        raise InputError("draws", draws, "must be at least 2")
    scorer = _bleu_scorer(candidates, references, order)
    scores = map(float, scorer.compute_score("closest")[0])
    counts = [
        [c["testlen"], min((abs(n - c["testlen"]), n) for n in c["reflen"])[1], *c["correct"], *c["guess"]]
        for c in scorer.ctest
    ]
    generator = generator or np.random.default_rng(0)
    number = len(counts)
    weights = generator.multinomial(number, np.full(number, 1 / number), size=draws)
    length, nearest, *rest = (weights @ np.array(counts, dtype=np.float64)).T
    correct, guess = np.array(rest[:order]), np.array(rest[order:])
    precision = np.log(np.maximum(correct, 1e-15) / np.maximum(guess, 1e-9)).cumsum(0)
    brevity = np.minimum(0, 1 - nearest / np.maximum(length, 1e-9))
    drawn = np.exp(precision / np.arange(1, order + 1)[:, None] + brevity)
    return tuple(Interval(*pair) for pair in zip(scores, 1.96 * drawn.std(1), strict=True))


def rouge_l(candidates: Sequence[str], references: References) -> float:
    """Mean ROUGE-L F-measure (Lin 2004, beta 1.2, the best precision and the best recall of the references)."""
    return float(_rouge_l(candidates, references).mean())


def cider(candidates: Sequence[str], references: References) -> float:
    """CIDEr-D (Vedantam et al. 2015), in [0, 10]; document frequencies are those of the references given.

    With a single candidate every word occurs in each document, so that the score is 0.
    """
    return float(_cider(candidates, references).mean())


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
    return float(_bert_score(candidates, references, model, layer).mean())


def _bleu_scorer(candidates: Sequence[str], references: References, order: int) -> Any:
    """What counts the runs of words of each caption."""
    from pycocoevalcap.bleu.bleu_scorer import BleuScorer

    texts, truths = _checked(candidates, references)
    scorer = BleuScorer(n=order)
    for index, [text] in texts.items():
        scorer += (text, truths[index])
    return scorer


def _rouge_l(candidates: Sequence[str], references: References) -> np.ndarray:
    """(N,) of each caption."""
    from pycocoevalcap.rouge.rouge import Rouge

    texts, truths = _checked(candidates, references)
    return np.asarray(Rouge().compute_score(truths, texts)[1])


def _cider(candidates: Sequence[str], references: References) -> np.ndarray:
    """(N,) of each caption."""
    from pycocoevalcap.cider.cider import Cider

    texts, truths = _checked(candidates, references)
    return np.asarray(Cider().compute_score(truths, texts)[1])


def _bert_score(
    candidates: Sequence[str], references: References, model: str | Path | None = None, layer: int | None = None
) -> np.ndarray:
    """(N,) of each caption."""
    from bert_score import BERTScorer
    from transformers.utils import logging

    from motionary.language.frozen import load_encoder, model_path

    texts, truths = _checked(candidates, references)
    path = model_path(model)
    layers = load_encoder(path)[1].config.num_hidden_layers
    if layer is not None and not 1 <= layer <= layers:
        raise InputError("layer", layer, f"must be from 1 to {layers}")
    rows = [index for index, [text] in texts.items() if text.strip()]
    found = np.zeros(len(texts))
    if not rows:
        return found
    logging.disable_progress_bar()
    try:
        scorer = BERTScorer(model_type=path, num_layers=layer or layers, device="cpu")
    finally:
        logging.enable_progress_bar()
    _, _, scores, *_ = scorer.score([texts[row][0] for row in rows], [truths[row] for row in rows])
    found[rows] = np.asarray(scores)
    return found


def caption_scores(
    candidates: Sequence[str], references: References, bert: bool = True, model: str | Path | None = None
) -> dict[str, Any]:
    """All scores of captions at once.

    Returns:
        ``bleu1``, ``bleu4``, ``rouge_l`` in [0, 1], ``cider`` in [0, 10], and with ``bert`` also ``bert_score``, each
        with its 95% interval over captions: of BLEU by `bleu_interval`, of the others, which are means, 1.96 sigma /
        sqrt(N). With ``bert`` also ``bert_model``, the name of the model behind it.

    Raises:
        InputError: no candidates, not one list of references for each, or an empty list or a blank text among these.
    """
    by_order = bleu_interval(candidates, references)
    scores: dict[str, Any] = {
        "bleu1": by_order[0],
        "bleu4": by_order[3],
        "rouge_l": interval(_rouge_l(candidates, references)),
        "cider": interval(_cider(candidates, references)),
    }
    if bert:
        from motionary.language.frozen import model_name

        scores["bert_score"] = interval(_bert_score(candidates, references, model))
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
