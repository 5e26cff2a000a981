"""Styles: a posture, a tempo and an amplitude, and a mood that adds each performer's own variation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motionary.corpus.demo.plan import Stance

TEMPO = {None: 1.0, "slow": 0.62, "fast": 1.42}


@dataclass(frozen=True)
class Style:
    """How a style changes a body; zeros and ones are neutral. Angles in radians, lengths in metres.

    Attributes:
        tempo, amplitude: factors on speed and on the size of movements.
        stoop: forward pitch of the spine; negative puts the chest out.
        lean: forward pitch of the pelvis.
        head: pitch of the head; positive looks down.
        crouch: how much lower the pelvis stands.
        arms: resting (flexion, abduction, twist, elbow) of both arms.
        width: added half distance of the feet.
        bounce: factor on the up and down of steps.
        swing: factor on the swing of the arms.
        roll: side to side sway of the trunk in steps.
    """

    tempo: float = 1.0
    amplitude: float = 1.0
    stoop: float = 0.0
    lean: float = 0.0
    head: float = 0.0
    crouch: float = 0.0
    arms: tuple[float, float, float, float] = (0.02, 0.13, 0.0, 0.25)
    width: float = 0.0
    bounce: float = 1.0
    swing: float = 1.0
    roll: float = 0.0


STYLES: dict[str, Style] = {
    "neutral": Style(),
    "happy": Style(1.12, 1.15, -0.08, 0.0, -0.2, 0.0, (0.1, 0.3, 0.15, 0.75), 0.01, 2.2, 1.35, 0.1),
    "tired": Style(0.74, 0.8, 0.42, 0.04, 0.5, 0.03, (0.3, 0.06, -0.1, 0.12), 0.0, 0.6, 0.5, 0.05),
    "old": Style(0.68, 0.72, 0.62, 0.22, -0.45, 0.09, (0.55, 0.1, -0.3, 1.0), 0.02, 0.4, 0.25, 0.09),
    "angry": Style(1.28, 1.15, 0.16, 0.12, 0.22, 0.03, (0.25, 0.42, -0.35, 1.25), 0.035, 1.2, 1.2, 0.0),
    "proud": Style(0.9, 1.05, -0.24, -0.03, -0.22, 0.0, (-0.12, 0.48, -0.2, 0.45), 0.03, 0.9, 1.25, 0.03),
}


@dataclass(frozen=True)
class Mood:
    """One performance of a style: the style with this performer's tempo, amplitude and stance.

    Attributes:
        tempo: factor on speed, with the style's, the spec's and the performer's share.
        amplitude: factor on the size of movements.
        stance: the pose between actions.
    """

    style: Style
    tempo: float
    amplitude: float
    stance: Stance

    def seconds(self, base: float) -> float:
        """A duration at this tempo."""
        return base / self.tempo

    def timed(self, *steps: float) -> np.ndarray:
        """Key times (0, ...) from the durations between them, at this tempo."""
        return np.concatenate([[0.0], np.cumsum(steps)]) / self.tempo


def mood(name: str, speed: str | None, rng: np.random.Generator) -> Mood:
    """A performance of style `name` at `speed` (None, slow or fast), with moderate random variation."""
    style = STYLES[name]
    vary = lambda spread: float(np.clip(rng.normal(1.0, spread), 1 - 2 * spread, 1 + 2 * spread))  # noqa: E731
    flexion, abduction, twist, elbow = style.arms
    drift = rng.normal(0.0, 0.025, 8)
    stance = Stance(
        width=0.088 + style.width + float(rng.uniform(-0.008, 0.012)),
        forward=0.105 + 0.12 * style.lean,
        toe_out=0.1 + float(rng.uniform(-0.06, 0.06)),
        height=-0.006 - style.crouch * vary(0.15),
        pelvis=(style.lean + 0.4 * drift[0], 0.0, 0.0),
        spine=(style.stoop * vary(0.12) + drift[1], 0.0, 0.0),
        head=(style.head * vary(0.12) + drift[2], 0.0, 0.0),
        arms=(flexion + drift[3], abduction + 0.5 * abs(drift[4]), twist + drift[5], elbow + abs(drift[6])),
    )
    return Mood(style, style.tempo * TEMPO[speed] * vary(0.06), style.amplitude * vary(0.07), stance)
