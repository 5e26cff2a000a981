"""From one text to another, step by step."""

from __future__ import annotations

from motionary.corpus.encoding import as_motion, frames_of, planted
from motionary.dictionary.prompted import Prompts
from motionary.errors import MOST_ASKED, check_whole
from motionary.motion import Motion, fit_rotations
from motionary.systems.protocols import TextBlender
from motionary.systems.registry import BLEND


class Blending(Prompts):
    """What a folder's systems make of two texts at once."""

    def blend(
        self, first: str, second: str, steps: int = 5, seconds: float | None = None, seed: int = 0,
        system: str | None = None, feet: bool = True,
    ) -> list[Motion]:  # fmt: skip
        """`steps` motions of one length, the first of one text, the last of the other, the rest between them.

        Args:
            first, second: English texts.
            steps: at least 2.
            seconds: length, rounded to whole motion tokens; None draws it from the first text.
            seed: equal texts, steps, length and seed give equal motions.
            system: the system that mixes texts; None takes the usual one.
            feet: let them stand; False gives what the system made.

        Raises:
            InputError: a text that cannot be read, a value out of range, a system that is not there.
        """
        check_whole("steps", steps, 2, MOST_ASKED)
        check_whole("seed", seed, 0)
        (one,), (other,) = self._sentences(first, "first"), self._sentences(second, "second")
        blender: TextBlender = self._open(BLEND, system)
        frames = None if seconds is None else frames_of(seconds, blender.context)
        with self._lock:
            made = blender.blend(one, other, steps, frames, seed)
        motions = planted([as_motion(features, blender.context) for features in made], feet)
        return [fit_rotations(motion) for motion in motions]
