"""Scores of a text-to-motion system: the papers' protocol, physics, the oracle, and how much it copies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from tqdm import tqdm

from motionary.corpus.context import Context
from motionary.corpus.encoding import as_features, as_motion, planted
from motionary.evaluation.confirmation import confirmed, fitted_oracle
from motionary.evaluation.items import Items, sentence_of
from motionary.evaluation.jury import Features, Jury
from motionary.evaluation.plausibility import mean_physics, plausibility
from motionary.evaluation.scores import Protocol
from motionary.language import Sentence, annotate
from motionary.metrics.distribution import multimodality
from motionary.metrics.intervals import Interval, interval
from motionary.oracle.prompts import PROMPTS, holds
from motionary.oracle.reading import read
from motionary.systems.protocols import TextToMotion


def score_generator(
    generator: TextToMotion,
    items: Items,
    jury: Jury,
    seed: int = 0,
    nearest: tuple[str, np.ndarray] | None = None,
) -> dict[str, Any]:
    """Report of a text-to-motion system.

    Args:
        generator: the system's.
        items: captioned test windows.
        jury: the judges, with repetitions and sizes.
        seed: of the generations.
        nearest: a judge, and its features (M, E) of the training motions, for the distance to the nearest of them.

    Returns:
        "generation" and "real": rows by part; "real" is judged with the same captions and pools. "agreement" of the
        judges on real motions. "physics", "oracle", "multimodality", and "nearest_training". "planted": rows, physics
        and captions confirmed of the same motions on the floor, with feet that stand
        (:func:`motionary.corpus.encoding.planted`). With ``protocol.real_lengths`` and a generator that takes lengths
        also "real_lengths": rows, physics and captions confirmed for motions as long as the real ones ("Ours w/ real
        length" of the thesis's Table 4.2).
    """
    protocol, real = jury.protocol, jury.motions(items.features)
    draws = [_Draw.make(generator, items, jury, seed, number) for number in _numbers(protocol)]
    first = draws[0]
    report: dict[str, Any] = {
        **_scores(draws, items, real, jury),
        "real": jury.rows([(d.text, real, d.parts) for d in draws], real),
        "agreement": jury.agreement(first.text, real),
        "multimodality": _multimodality(generator, items, jury, seed),
    }
    report["physics"]["real"] = plausibility(items, items.features)
    report["oracle"] |= {
        "captions_real": confirmed(items, first.sentences, items.features, first.parts),
        "captions_chance": confirmed(items, first.sentences, others(items), first.parts),
        "prompts": _prompts(generator, items, protocol, seed),
    }
    report["planted"] = _planted(draws, items, real, jury)
    if nearest is not None:
        judge, training = nearest
        report["nearest_training"] = {
            "generated": nearest_distance(first.motion[judge], training),
            "real": nearest_distance(real[judge], training),
        }
    if protocol.real_lengths and generator.takes_lengths:
        frames = [len(features) for features in items.features]
        held = [_Draw.make(generator, items, jury, seed, number, frames) for number in _numbers(protocol)]
        report["real_lengths"] = _scores(held, items, real, jury)
    return report


@dataclass(frozen=True)
class _Draw:
    """One generation of the whole split: what was asked, what came, and the judges' features of both."""

    sentences: list[Sentence]
    generated: list[np.ndarray]
    text: Features
    motion: Features
    parts: dict[str, np.ndarray]

    @classmethod
    def make(
        cls,
        generator: TextToMotion,
        items: Items,
        jury: Jury,
        seed: int,
        number: int,
        frames: Sequence[int] | None = None,
    ) -> _Draw:
        """Generates for repetition `number`; `frames` are lengths to hold, one an item."""
        captions = items.choose(number)
        sentences = [sentence_of(items.corpus, c) for c in captions]
        label = f"generate {number + 1}{'' if frames is None else ', real lengths'}"
        generated = _generate(
            generator, items.corpus.context, sentences, seed + 1_000_003 * number, jury.protocol, label, frames
        )
        return cls(sentences, generated, jury.sentences(sentences), jury.motions(generated), items.parts(captions))


def _numbers(protocol: Protocol) -> range:
    return range(protocol.generation_repetitions)


def _scores(draws: Sequence[_Draw], items: Items, real: Features, jury: Jury) -> dict[str, Any]:
    """Scores of generations, whatever decided their lengths; physics and the oracle look at the first draw only."""
    first = draws[0]
    return {
        "generation": jury.rows([(d.text, d.motion, d.parts) for d in draws], real),
        "physics": {"generated": plausibility(items, first.generated)},
        "oracle": {"captions": confirmed(items, first.sentences, first.generated, first.parts)},
    }


def _planted(draws: Sequence[_Draw], items: Items, real: Features, jury: Jury) -> dict[str, Any]:
    """Scores of the generations with feet that stand; physics are those of the motions, without the codec's loss."""
    context, after, motions = items.corpus.context, [], []
    for draw in draws:
        made = tqdm(draw.generated, desc="plant feet", unit="motion")
        motions.append([planted([as_motion(features, context)])[0] for features in made])
        features = [as_features(motion, context) for motion in motions[-1]]
        after.append(replace(draw, generated=features, motion=jury.motions(features)))
    return _scores(after, items, real, jury) | {"physics": {"generated": mean_physics(motions[0])}}


def _generate(
    generator: TextToMotion, context: Context, sentences: Sequence[Sentence], seed: int, protocol: Protocol, label: str,
    frames: Sequence[int] | None = None,
) -> list[np.ndarray]:  # fmt: skip
    out: list[np.ndarray] = []
    starts = range(0, len(sentences), protocol.batch_size)
    for start in tqdm(starts, desc=label, unit="batch"):
        rows = slice(start, start + protocol.batch_size)
        part = sentences[rows]
        lengths = None if frames is None else frames[rows]
        made = generator.generate(part, seeds=[seed + start + i for i in range(len(part))], frames=lengths)
        out += [as_features(motion, context) for motion in made]
    return out


def _prompts(generator: TextToMotion, items: Items, protocol: Protocol, seed: int) -> dict[str, Any]:
    """The oracle's own prompts about side, direction and speed, several motions each."""
    prompts = [prompt for prompt in PROMPTS for _ in range(protocol.prompt_samples)]
    generated = _generate(
        generator, items.corpus.context, annotate([p.text for p in prompts]), seed + 17, protocol, "prompts"
    )
    thresholds, motions = fitted_oracle(items.corpus), items.motions(generated)
    verdicts = [holds(read(m, thresholds), p.claims) for m, p in zip(motions, prompts, strict=True)]
    each = np.reshape(verdicts, (-1, protocol.prompt_samples)).mean(1)
    by_prompt = {prompt.text: round(float(share), 3) for prompt, share in zip(PROMPTS, each, strict=True)}
    return {"confirmed": round(float(each.mean()), 4), "samples": len(prompts), "each": by_prompt}


def _multimodality(generator: TextToMotion, items: Items, jury: Jury, seed: int) -> dict[str, Any]:
    """Samples are drawn once; the repetitions draw the pairs, the same for every judge."""
    protocol = jury.protocol
    texts, samples = min(protocol.multimodality_texts, len(items)), protocol.multimodality_samples
    rng = np.random.default_rng([seed, 31])
    chosen = items.choose(0)[rng.permutation(len(items))[:texts]]
    sentences = [sentence_of(items.corpus, c) for c in chosen for _ in range(samples)]
    generated = _generate(generator, items.corpus.context, sentences, seed + 500_000_003, protocol, "multimodality")
    found = {name: f.reshape(texts, samples, -1) for name, f in jury.motions(generated).items()}
    spreads = {name: _spreads(features, protocol).report() for name, features in found.items()}
    own = spreads.pop(jury.first) | {"texts": texts, "samples": samples}
    return own | ({"by": spreads} if spreads else {})


def _spreads(features: np.ndarray, protocol: Protocol) -> Interval:
    """Multimodality of features (texts, samples, E) over the repetitions."""
    pairs, draws = protocol.multimodality_pairs, range(protocol.repetitions)
    return interval([multimodality(features, pairs, np.random.default_rng([r, 37])) for r in draws])


def others(items: Items) -> list[np.ndarray]:
    """For each item the motion of another, drawn once. How often the oracle confirms these is its rate by chance."""
    order = np.random.default_rng(41).permutation(len(items))
    chosen = np.empty_like(order)
    chosen[order] = np.roll(order, 1)
    return [items.features[i] for i in chosen]


def nearest_distance(features: np.ndarray, training: np.ndarray) -> dict[str, float]:
    """Mean and smallest distance, in the evaluator's space, from each motion to the nearest training motion."""
    best = []
    for start in range(0, len(features), 256):
        part = features[start : start + 256]
        squared = (part**2).sum(1)[:, None] + (training**2).sum(1)[None] - 2 * part @ training.T
        best.append(np.sqrt(np.clip(squared.min(1), 0, None)))
    distances = np.concatenate(best)
    return {"mean": round(float(distances.mean()), 5), "least": round(float(distances.min()), 5)}
