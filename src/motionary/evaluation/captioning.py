"""Scores of a motion-to-text system: language metrics against normalized and raw captions, and retrieval."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from tqdm import tqdm

from motionary.evaluation.items import Items
from motionary.evaluation.jury import Jury
from motionary.evaluation.labels import captions_by_labels, score_by_labels
from motionary.evaluation.scores import Protocol
from motionary.language import Sentence, annotate
from motionary.metrics.captions import caption_scores
from motionary.metrics.intervals import Interval
from motionary.systems.protocols import MotionToText

CONSENSUS = 40  # draws, of which one becomes the caption


def score_captioner(captioner: MotionToText, items: Items, jury: Jury) -> dict[str, Any]:
    """Report of a motion-to-text system.

    Captions come from a beam search of size 2 (TM2T 4.3). Where the captioner can draw, "consensus" scores those by
    consensus of its draws too: with many wordings of one meaning the likeliest one is seldom the one that agrees
    best with the references.

    Args:
        captioner: the system's.
        items: captioned test windows.
        jury: the judges, with repetitions and sizes.

    Returns:
        "language": for each part the scores against the normalized captions, and against the raw ones under "raw";
        "captioning": R-precision and distances of the captions; "action": share of captions that name the action
        that the reference names; "labels": see `score_by_labels`; the same four under "consensus"; "real": R-precision
        and distances of real captions; "examples".
    """
    references = [[" ".join(s.words) for s in options] for options in items.references]
    raw = [[s.text for s in options] for options in items.references]
    parts, known = items.parts(items.choose(0)), captions_by_labels(items.corpus)
    features, protocol = jury.motions(items.features), jury.protocol

    def scores(captions: list[str]) -> dict[str, Any]:
        """What is reported of captions, one for each item."""
        sentences, language = annotate(captions), {}
        # What a captioner writes as people do is normalized to be scored beside the others.
        normal = [s.normalized for s in sentences] if captioner.written else captions
        for name, where in parts.items():
            own, said = ([texts[i] for i in where] for texts in (normal, captions))
            language[name] = {
                "items": len(where),
                **_rounded(caption_scores(own, [references[i] for i in where], bert=protocol.bert_score)),
                "raw": _rounded(caption_scores(said, [raw[i] for i in where], bert=False)),
            }
        judged = jury.rows([(jury.sentences(sentences), features, parts)], features)
        action = {name: named_action(sentences, items, where) for name, where in parts.items()}
        by_labels = score_by_labels(normal, references, items, known)
        return {"language": language, "captioning": _retrieval(judged), "action": action, "labels": by_labels}

    captions = caption_all(captioner, items, protocol)
    real_text = jury.sentences([options[0] for options in items.references])
    report = {
        **scores(captions),
        "real": _retrieval(jury.rows([(real_text, features, parts)], features)),
        "examples": [
            {"caption": captions[i], "references": raw[i]} for i in np.linspace(0, len(items) - 1, 12).astype(int)
        ],
    }
    if captioner.draws:
        agreed = caption_all(captioner, items, protocol, CONSENSUS)
        report["consensus"] = {"draws": CONSENSUS, **scores(agreed)}
    return report


def _retrieval(rows: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """The rows without metrics of the motions' distribution: here the motions are the real ones."""

    def of_texts(row: dict[str, Any]) -> dict[str, Any]:
        """A row without what is said of motions."""
        kept = {k: v for k, v in row.items() if not k.startswith(("fid", "diversity"))}
        return kept | ({"by": {name: of_texts(r) for name, r in row["by"].items()}} if "by" in row else {})

    return {name: of_texts(row) for name, row in rows.items()}


def caption_all(captioner: MotionToText, items: Items, protocol: Protocol, consensus: int = 0) -> list[str]:
    """The best caption of every item: of beam search, or by consensus of this many draws."""
    out: list[str] = []
    for start in tqdm(
        range(0, len(items), protocol.batch_size), desc="consensus" if consensus else "caption", unit="batch"
    ):
        features = items.features[start : start + protocol.batch_size]
        # Each item has its own noise: the luck of the draws must not fall on all of them alike.
        drawn = {"consensus": consensus, "seeds": range(start, start + len(features))} if consensus else {}
        out += [texts[0] for texts in captioner.caption(features, beams=2, **drawn)]
    return out


def named_action(sentences: Sequence[Sentence], items: Items, where: np.ndarray) -> dict[str, float]:
    """Share of captions that name an action, and only actions that the item's own captions name.

    Actions are the words of the motion dictionary's class Action (thesis 4.2.3); items whose captions hold none are
    not counted.
    """
    hits = []
    for i in where:
        truth = set().union(*(_actions(s) for s in items.references[i]))
        if truth:
            named = _actions(sentences[i])
            hits.append(bool(named) and named <= truth)
    return {"named": round(float(np.mean(hits)), 4) if hits else 0.0, "checked": len(hits)}


def _actions(sentence: Sentence) -> set[str]:
    return {word for word, tag in zip(sentence.words, sentence.tags, strict=True) if tag == "ACTION"}


def _rounded(scores: dict[str, Any]) -> dict[str, Any]:
    """Intervals as reports hold them; other values stay as they are."""
    return {name: v.report() if isinstance(v, Interval) else v for name, v in scores.items()}
