"""Position errors of generated motions against the one real motion of their text (TEMOS Eq. 4-6, Tables 1 and 2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, Protocol

import numpy as np
from tqdm import tqdm

from motionary.corpus.encoding import as_motion
from motionary.evaluation.items import Items, sentence_of
from motionary.metrics.intervals import paired_bootstrap
from motionary.metrics.mmm import SCALE, mmm_joints
from motionary.metrics.position import PositionErrors, sample_errors
from motionary.motion import Motion, heading
from motionary.motion.facing import rotate_y
from motionary.systems.protocols import TextToMotion


class AtSourceRate(Protocol):
    """Real motions with more frames than the corpus keeps, as :class:`motionary.corpus.originals.Originals` reads them.
    Not imported: a mended reader of files would make every evaluation run again."""

    def motion(self, row: int) -> Motion | None:
        """Window `row` of the corpus, None where its source has no more frames."""
        ...


ERRORS = tuple(field.name for field in fields(PositionErrors))


def score_positions(
    generator: TextToMotion,
    items: Items,
    samples: int = 10,
    most: int = 0,
    seed: int = 0,
    batch_size: int = 64,
    originals: AtSourceRate | None = None,
) -> dict[str, Any]:
    """APE and AVE with true durations, for the first caption of each item.

    Args:
        generator: takes lengths.
        items: captioned test windows.
        samples: motions of each text beside that of the mean latent.
        most: items that count, spread over the split; 0 takes all.
        seed: of the draws.
        batch_size: texts of a call.
        originals: real motions at their source's rate, where that is higher than the corpus's: generated joints are
            then interpolated linearly to it (TEMOS 4.1).

    Returns:
        "rows": the eight errors as {"mean", "half"} for "z = 0" (the mean latent), "one sample", and the "mean", the
        "best" and the "worst" of all samples by the APE of the root; half is that of a 95% interval over items.
        "fps": of the real motions, their mean. "mmm": the first two rows on the joints and in the size of the Master
        Motor Map (TEMOS Table A.7), where the skeleton has them. "curve": the root's APE of the best of the first 1,
        2, ... samples (Fig. A.1). "gain": one sample less the best, with its paired 95% interval.
    """
    chosen = np.arange(len(items)) if not most else np.unique(np.linspace(0, len(items) - 1, most).astype(int))
    real = [ahead(motion) for motion in items.motions([items.features[i] for i in chosen])]
    target = [_original(originals, items.rows[i]) or motion for i, motion in zip(chosen, real, strict=True)]
    # As long as the features, which are a frame fewer than the motion that they were made of.
    frames = np.array([motion.frames for motion in real])
    sentences = [sentence_of(items.corpus, items.captions[i][0]) for i in chosen]

    def made(number: int, greedy: bool = False) -> list[Motion]:
        """One motion a text."""
        seeds = [seed + 1_000_003 * number + i for i in range(len(sentences))]
        out: list[Motion] = []
        for start in tqdm(range(0, len(sentences), batch_size), desc=f"positions {number}", unit="batch"):
            part = slice(start, start + batch_size)
            found = generator.generate(sentences[part], seeds[part], frames[part].tolist(), greedy=greedy)
            out += [ahead(as_motion(motion, items.corpus.context)) for motion in found]
        return [interpolated(motion, wanted) for motion, wanted in zip(out, target, strict=True)]

    first, likeliest = made(0), made(0, greedy=True)
    drawn = [_errors(first, target), *(_errors(made(number), target) for number in range(1, samples))]
    report: dict[str, Any] = {"items": len(chosen), "samples": samples}
    report["fps"] = round(float(np.mean([motion.fps for motion in target])), 3)
    report |= _rows(_errors(likeliest, target), np.stack(drawn), np.array([motion.frames for motion in target]))
    if joints := mmm_joints(real[0].skeleton):
        mapped = {"z = 0": likeliest, "one sample": first}
        report["mmm"] = {name: _row(_errors(found, target, joints, SCALE), frames) for name, found in mapped.items()}
    return report


def ahead(motion: Motion) -> Motion:
    """The motion from the origin on, its first frame facing +z; heights stay (TEMOS appendix C)."""
    positions = motion.positions.astype(np.float64) - motion.positions[0, 0] * [1, 0, 1]
    return Motion(rotate_y(positions, -heading(motion)[0]), motion.fps, motion.skeleton)


def _original(originals: AtSourceRate | None, row: int) -> Motion | None:
    found = None if originals is None else originals.motion(row)
    return None if found is None else ahead(found)


def interpolated(motion: Motion, like: Motion) -> Motion:
    """The joints at the rate and for the frames of another motion, by straight lines; the last frame is held."""
    if motion.fps == like.fps:
        return motion.crop(0, like.frames)
    at = np.minimum(np.arange(like.frames) * (motion.fps / like.fps), motion.frames - 1)
    before = np.minimum(at.astype(int), motion.frames - 1)
    after, share = np.minimum(before + 1, motion.frames - 1), (at - before)[:, None, None]
    positions = (1 - share) * motion.positions[before] + share * motion.positions[after]
    return Motion(positions, like.fps, motion.skeleton)


def _errors(
    made: Sequence[Motion], real: Sequence[Motion], joints: Sequence[int] | None = None, factor: float = 1.0
) -> np.ndarray:
    """(N, 8) errors of one motion a text."""
    pairs = zip(made, real, strict=True)
    return np.stack([sample_errors(a, b, joints, factor) for a, b in pairs])


def _rows(mean: np.ndarray, drawn: np.ndarray, frames: np.ndarray) -> dict[str, Any]:
    """Rows, curve and gain of errors (N, 8) at the mean latent and (samples, N, 8) of draws."""
    root = drawn[..., 0]
    rows = {
        "z = 0": mean,
        "one sample": drawn[0],
        f"mean of {len(drawn)}": drawn.mean(0),
        f"best of {len(drawn)}": _picked(drawn, root.argmin(0)),
        f"worst of {len(drawn)}": _picked(drawn, root.argmax(0)),
    }
    best = np.minimum.accumulate(root, axis=0)  # (samples, N)
    gain, low, high = paired_bootstrap(root[0], best[-1], draws=2000)
    return {
        "rows": {name: _row(errors, frames) for name, errors in rows.items()},
        "curve": [round(float(np.average(errors, weights=frames)), 6) for errors in best],
        "gain": {"mean": round(gain, 6), "low": round(low, 6), "high": round(high, 6)},
    }


def _picked(drawn: np.ndarray, which: np.ndarray) -> np.ndarray:
    return drawn[which, np.arange(drawn.shape[1])]


def _row(errors: np.ndarray, frames: np.ndarray) -> Mapping[str, Mapping[str, float]]:
    """Means over the items of (N, 8) errors, where frames weigh alike in the APE and items in the AVE (Eq. 4, 5)."""
    weights: Sequence[np.ndarray] = [frames] * 4 + [np.ones_like(frames)] * 4
    half = 1.96 * errors.std(0) / np.sqrt(len(errors))
    means = [np.average(errors[:, k], weights=weights[k]) for k in range(len(ERRORS))]
    values = zip(ERRORS, means, half, strict=True)
    return {name: {"mean": round(float(m), 6), "half": round(float(h), 6)} for name, m, h in values}
