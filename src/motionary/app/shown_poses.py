"""Poses that a visitor asks for: those of the motions on show, at seconds of the motion to come."""

from __future__ import annotations

import re
from collections.abc import Sequence

from motionary.app.player import Item
from motionary.errors import InputError
from motionary.motion import Motion

MOST = 10
_POSE = re.compile(r"(\d+(?:\.\d+)?)=(\d+)(?:@(\d+(?:\.\d+)?))?")


def read_poses(text: str, items: Sequence[Item]) -> dict[float, Motion]:
    """The poses by their seconds, of "0=1@0.5 2=1": at 0 s that of the first motion at its second 0.5, at 2 s that of
    its beginning.

    Raises:
        InputError: another form, a motion that is not on show or is shorter, a second named twice, too many.
    """
    found: dict[float, Motion] = {}
    for part in text.replace(",", " ").split():
        told = _POSE.fullmatch(part)
        if told is None:
            raise InputError("poses", part, "must be like 2=1@0.5: at 2 s the pose of motion 1 at its second 0.5")
        seconds, number, at = float(told[1]), int(told[2]), float(told[3] or 0)
        if not 1 <= number <= len(items):
            raise InputError("poses", part, f"motions on show: {len(items)}")
        motion = items[number - 1].motion
        if at > motion.duration:
            raise InputError("poses", part, f"motion {number} lasts {motion.duration:.2f} s")
        if seconds in found or len(found) == MOST:
            rule = "names a second that another pose has" if seconds in found else f"at most {MOST} poses"
            raise InputError("poses", part, rule)
        frame = min(round(at * motion.fps), motion.frames - 1)
        found[seconds] = motion.crop(frame, frame + 1)
    return found
