"""A player of motions in one HTML file that needs no network; also as a fragment for other pages."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Sequence
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.files import write_bytes
from motionary.formats.render.figure import limbs
from motionary.formats.render.scene import Scene
from motionary.motion import Motion

_STYLE = """
.motionary{font:14px/1.4 system-ui,sans-serif;color:#2d3442;max-width:100%;margin:0 auto}
.motionary .row{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(220px,100%),1fr));gap:10px}
.motionary figure{margin:0;border:1px solid #dde2ea;border-radius:8px;overflow:hidden;background:#fff}
.motionary canvas{display:block;width:100%;aspect-ratio:1;max-height:70vh;cursor:grab;touch-action:none}
.motionary figcaption{padding:6px 10px;text-align:center;overflow-wrap:anywhere}
.motionary .bar{display:flex;gap:10px;align-items:center;padding:8px 2px}
.motionary .bar input{flex:1;min-width:60px;accent-color:#3e8cc8}
.motionary .bar button{width:38px;height:30px;border:1px solid #c9d0da;border-radius:6px;background:#fff;cursor:pointer}
.motionary .bar output{font-variant-numeric:tabular-nums;min-width:88px;text-align:right}
""".strip()


def player_html(
    motions: Sequence[tuple[str, Motion]], page: bool = False, title: str = "motionary", autoplay: bool = True
) -> str:
    """A player with scrubber, play and pause, speed and a camera to drag; several motions side by side.

    A fragment brings its script and style; a page with many players holds `player_assets` once and a
    `player_fragment` for each instead.

    Args:
        motions: (caption, motion) pairs; the longest sets the length.
        page: a whole page instead of a fragment.
        title: of the page.
        autoplay: start at once.

    Returns:
        HTML. Positions are int16: in a room of 16 m they are exact to an eighth of a millimetre.

    Raises:
        InputError: no motions.
    """
    fragment = player_assets() + player_fragment(motions, autoplay)
    if not page:
        return fragment
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<style>body{{margin:24px;background:#fff}}</style></head>\n<body>{fragment}</body></html>\n"
    )


@cache
def player_assets() -> str:
    """The style and script that `player_fragment`s need once on their page (before or after them)."""
    script = (files("motionary.formats.render") / "player.js").read_text("utf-8")
    return f"<style>{_STYLE}</style><script>{script}</script>"


def player_fragment(motions: Sequence[tuple[str, Motion]], autoplay: bool = True) -> str:
    """The player's HTML and data alone; see `player_assets`.

    Raises:
        InputError: no motions.
    """
    if not motions:
        raise InputError("motions", "none", "at least one (caption, motion) pair is needed")
    figures = "".join(
        f"<figure><canvas></canvas>{f'<figcaption>{escape(caption)}</figcaption>' if caption else ''}</figure>"
        for caption, _ in motions
    )
    packed = [_pack(motion) for _, motion in motions]
    for one in packed:  # side by side a metre is as long in each
        one["distance"] = max(other["distance"] for other in packed)
    data = json.dumps({"motions": packed, "autoplay": autoplay})
    data = data.replace("<", "\\u003c")  # nothing in the data can close its element
    speeds = "".join(f"<option value={s}{' selected' * (s == 1)}>{s}x</option>" for s in (0.25, 0.5, 1, 2))
    return (
        f'<div class="motionary"><div class="row">{figures}</div><div class="bar">'
        '<button type="button" aria-label="play"></button>'
        '<input type="range" min="0" max="1000" value="0" aria-label="time">'
        f'<select aria-label="speed">{speeds}</select><output></output></div>'
        f'<script type="application/json">{data}</script></div>'
        "<script>window.motionaryPlayers&&window.motionaryPlayers()</script>"
    )


def write_page(
    motions: Motion | Sequence[Motion],
    path: str | os.PathLike,
    captions: str | Sequence[str] | None = None,
    title: str = "motionary",
    force: bool = True,
) -> Path:
    """Write a page with a player of one motion or of several side by side; it opens from disk without a network.

    Raises:
        InputError: see `write_motion`; captions that do not match.
    """
    motions = [motions] if isinstance(motions, Motion) else list(motions)
    captions = [captions] if isinstance(captions, str) else list(captions or [""] * len(motions))
    if len(captions) != len(motions):
        raise InputError("captions", f"{len(captions)} of them", f"one for each of {len(motions)} motions")
    return write_bytes(path, player_html(list(zip(captions, motions, strict=True)), page=True, title=title), force)


def _pack(motion: Motion) -> dict[str, Any]:
    """What the player needs of a motion: only the joints that are drawn, on the floor, as int16."""
    scene = Scene(motion, 64, 64)
    parts = limbs(motion.skeleton)
    joints = sorted({0, *(part.begin for part in parts), *(part.end for part in parts)})
    new = {joint: i for i, joint in enumerate(joints)}
    positions = motion.positions[:, joints].astype(np.float64) - scene.down
    origin = (positions.min((0, 1)) + positions.max((0, 1))) / 2
    step = max(float(np.abs(positions - origin).max()) / 32767, 1e-5)
    quantized = np.rint((positions - origin) / step).astype("<i2")
    return {
        "data": base64.b64encode(quantized.tobytes()).decode(),
        "frames": motion.frames,
        "joints": len(joints),
        "fps": motion.fps,
        "step": step,
        "origin": [round(float(x), 6) for x in origin],
        "limbs": [
            [new[p.begin], new[p.end], round(p.radii[0], 4), round(p.radii[1], 4), p.side, round(p.reach, 4)]
            for p in parts
        ],
        "top": round(float(scene.target[0, 1]) / 0.47, 4),
        "distance": round(float(scene.camera.distance), 4),
        "azimuth": round(float(scene.camera.azimuth), 4),
        "travels": bool(len(scene.path)),
    }
