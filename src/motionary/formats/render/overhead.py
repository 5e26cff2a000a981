"""The path of a motion over the ground, seen from above: stills under a camera that follows the body do not show it."""

from __future__ import annotations

import numpy as np

from motionary.formats.render.scene import azimuth_of
from motionary.motion import Motion, heading

_FINE = 3  # pixels drawn for each of the picture, which are averaged
_DOT = 3 * _FINE  # its radius
_GROUND, _LINES = (238, 239, 243), (214, 217, 225)
_BEGIN, _END = np.array([245, 186, 96]), np.array([104, 46, 0])  # colours of the path
_LEAST = 1.2  # metres that are shown at least
_EDGE = 0.14  # of the picture's sides, around the path
_MOST = 400  # pieces of the path


def draw_overhead(motion: Motion, moments: np.ndarray, width: int, height: int) -> np.ndarray:
    """The root's path from above, the viewer of the stills below it.

    The path grows darker with time; at each moment a dot stands on it, with a line to where the body faces. Lines on
    the ground are a metre apart.

    Args:
        motion: of any rig; one whose hips and shoulders are not known has no lines.
        moments: (N,) frames.
        width, height: pixels.

    Returns:
        (H, W, 3) uint8.
    """
    from PIL import Image, ImageDraw

    turn = azimuth_of(motion)
    across, nearer = np.array([np.cos(turn), -np.sin(turn)]), np.array([np.sin(turn), np.cos(turn)])
    flat = motion.positions[:, 0].astype(np.float64)[:, [0, 2]]
    path = np.stack([flat @ across, flat @ nearer], -1)  # metres to the right and down in the picture
    low, high = path.min(0), path.max(0)
    sides = np.array([width, height]) * _FINE
    pixels = float(((1 - 2 * _EDGE) * sides / np.maximum(high - low, _LEAST)).min())  # a metre's

    def place(points: np.ndarray) -> np.ndarray:
        """Metres as pixels."""
        return (points - (low + high) / 2) * pixels + sides / 2

    image = Image.new("RGB", tuple(sides.tolist()), _GROUND)
    brush = ImageDraw.Draw(image)
    for axis in (0, 1):
        reach = sides[axis] / pixels / 2
        middle = (low + high)[axis] / 2
        for metre in range(int(np.ceil(middle - reach)), int(np.floor(middle + reach)) + 1):
            at = float(place(np.full(2, float(metre)))[axis])
            ends = [(at, 0), (at, sides[1])] if axis == 0 else [(0, at), (sides[0], at)]
            brush.line([(float(x), float(y)) for x, y in ends], fill=_LINES, width=_FINE)
    frames = np.linspace(0, motion.frames - 1, min(motion.frames, _MOST)).astype(int)
    points = place(path[frames])
    for i in range(len(points) - 1):
        brush.line([tuple(points[i]), tuple(points[i + 1])], fill=_shade(i / len(points)), width=2 * _FINE)
    known = len({*motion.skeleton.hips, *motion.skeleton.shoulders}) == 4
    faces = heading(motion) if known else None
    for number, frame in enumerate(np.round(moments).astype(int)):
        (x, y), shade = place(path[frame]), _shade(number / max(1, len(moments) - 1))
        if faces is not None:
            angle = faces[frame] - turn  # 0: towards the viewer
            length = 0.13 * float(sides.min())
            brush.line([(x, y), (x + np.sin(angle) * length, y + np.cos(angle) * length)], fill=shade, width=2 * _FINE)
        brush.ellipse((x - _DOT, y - _DOT, x + _DOT, y + _DOT), fill=shade)
    return np.asarray(image.resize((width, height), Image.Resampling.BOX))


def _shade(share: float) -> tuple[int, ...]:
    """The path's colour at a share of its time."""
    return tuple(int(c) for c in np.round(_BEGIN + share * (_END - _BEGIN)))
