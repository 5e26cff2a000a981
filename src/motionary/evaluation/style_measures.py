"""What is measured of stylized and of real motions: verdicts of the classifiers, rotations, physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from motionary.corpus.cells import StyleSplit
from motionary.corpus.context import Context
from motionary.corpus.encoding import as_features, planted
from motionary.corpus.store import Corpus
from motionary.evaluation.style_draws import Draw
from motionary.metrics.classification import accuracy, macro_accuracy
from motionary.metrics.distribution import frechet_distance
from motionary.metrics.physics import MEASURES, physics
from motionary.metrics.position import geodesic_distance
from motionary.motion import Motion, fit_rotations
from motionary.systems.protocols import StyleClassifier


@dataclass(frozen=True)
class Measured:
    """Of N motions: labels (N,) and features (N, E) by both classifiers (None without style labels in the corpus), and
    the physical measures (N, M) in the order of `MEASURES`; `labels` (N,) are the style ids that real motions truly
    have."""

    physics: np.ndarray
    style: np.ndarray | None = None
    style_features: np.ndarray | None = None
    content: np.ndarray | None = None
    content_features: np.ndarray | None = None
    labels: np.ndarray | None = None

    def take(self, where: np.ndarray) -> Measured:
        """Those at positions `where`."""
        return Measured(**{name: v[where] for name, v in vars(self).items() if v is not None})


class Measures:
    """Measures motions; real ones only once."""

    def __init__(self, judge: StyleClassifier, corpus: Corpus):
        self.judge, self.corpus = judge, corpus
        self.context = corpus.context
        self.codec, self.fps = corpus.context.make_codec(), corpus.context.fps
        self._known: Measured | None = None
        self._place: dict[int, int] = {}

    def of(self, features: Sequence[np.ndarray]) -> Measured:
        """Measures the motions of raw features, each (T, D)."""
        return self._judged([self.codec.decode(f, fps=self.fps) for f in features], features)

    def planted(self, features: Sequence[np.ndarray]) -> Measured:
        """Measures the motions of raw features, each (T, D), with feet planted."""
        motions = planted([self.codec.decode(f, fps=self.fps) for f in features])
        return self._judged(motions, [as_features(motion, self.context) for motion in motions])

    def _judged(self, motions: Sequence[Motion], features: Sequence[np.ndarray]) -> Measured:
        measured = np.array([[*physics(motion).values()] for motion in motions])
        if not self.judge.trained:
            return Measured(measured)
        style, style_features = self.judge.style(features)
        content, content_features = self.judge.content(features)
        return Measured(measured, style.argmax(1), style_features, content.argmax(1), content_features)

    def real(self, rows: np.ndarray) -> Measured:
        """Measures the windows at rows of the corpus, with their labels."""
        new = [row for row in dict.fromkeys(rows.tolist()) if row not in self._place]
        if new:
            found = replace(self.of([self.corpus.features(i) for i in new]), labels=self.corpus.style_ids[new])
            start = len(self._place)
            self._place |= {row: start + i for i, row in enumerate(new)}
            self._known = found if self._known is None else _joined(self._known, found)
        assert self._known is not None
        return self._known.take(np.array([self._place[row] for row in rows.tolist()]))


def _joined(a: Measured, b: Measured) -> Measured:
    return Measured(**{name: np.concatenate([v, vars(b)[name]]) for name, v in vars(a).items() if v is not None})


def scored(
    found: Measured, content: Measured | None, style: Measured | None, draw: Draw, split: StyleSplit, targeted: bool
) -> dict[str, float]:
    """Metrics of one row in one repetition.

    Args:
        found: of the motions to score.
        content: of the motions whose content they should have, for the content FID.
        style: of real motions in the target styles, for the style FID, with their labels.
        draw: what was asked for.
        split: its scored styles count, each alike (macro).
        targeted: False where no style was asked for: then there is no right one.

    Returns:
        Those of style_accuracy, style_fid, content_accuracy and content_fid that there are, and every measure of
        `MEASURES`.
    """
    values = dict(zip(MEASURES, found.physics.mean(0).tolist(), strict=True))
    if found.style is None:
        return values
    if targeted and split.scored:
        values["style_accuracy"] = macro_accuracy(found.style, draw.targets, split.scored)
        if style is not None:
            values |= _style_fid(found, style, draw.targets)
    if (draw.actions >= 0).all():
        values["content_accuracy"] = accuracy(found.content, draw.actions)
    if content is not None:
        values["content_fid"] = frechet_distance(found.content_features, content.content_features)
    return values


def _style_fid(found: Measured, style: Measured, targets: np.ndarray) -> dict[str, float]:
    """Mean over the target styles of the Frechet distance to real motions of that style.

    The thesis takes one distance over all styles together; contents and targets are of as many styles, so that it
    could not tell a copied content from a stylized one.
    """
    distances = []
    for label in np.unique(targets):
        made, real = found.take(targets == label), style.take(style.labels == label)
        if len(made.physics) >= 2 and len(real.physics) >= 2:
            distances.append(frechet_distance(made.style_features, real.style_features))
    return {"style_fid": float(np.mean(distances))} if distances else {}


def local_rotations(features: Sequence[np.ndarray], context: Context, step: int = 1) -> np.ndarray:
    """(P, K, 4) true local rotations of every `step`-th pose of all motions, in their order.

    They are fitted to the joints (:func:`motionary.motion.fit_rotations`), for all motions at once, since that costs a
    tenth of one after the other. The K joints are those that turn a bone: the root's rotation is no local one, and a
    joint without children has none of its own. The root's path is left out, so that it changes nothing.
    """
    poses = np.concatenate([f[::step] for f in features]).astype(np.float32)
    codec, skeleton = context.make_codec(), context.skeleton
    for name in ("root_angular", "root_linear"):
        poses[:, codec.slices[name]] = 0
    positions = codec.decode(poses, fps=context.fps).positions
    rotations = fit_rotations(Motion(positions, context.fps, skeleton)).rotations
    assert rotations is not None
    return rotations[:, [j for j in range(1, len(skeleton)) if j in skeleton.parents]]


def turned(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(P,) mean angle in radians between the local rotations (P, K, 4) of poses (thesis 5.3, "geodesic distance")."""
    return geodesic_distance(a, b).mean(-1)


def spread(x: np.ndarray) -> float:
    """Mean distance of two samples of one content: x (C, S, E) features of S samples each, over all pairs.

    The thesis's Eq. 3.20 draws some of the pairs at random.
    """
    distance = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1)
    first, second = np.triu_indices(x.shape[1], 1)
    return float(distance[:, first, second].mean())
