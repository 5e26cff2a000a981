"""Videos (mp4, gif), single frames and strips of stills: several motions side by side, each with a caption."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import threading
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from tqdm import tqdm

from motionary.errors import InputError
from motionary.files import DISK_REFUSALS, atomic_file
from motionary.formats.render.overhead import draw_overhead
from motionary.formats.render.scene import Scene
from motionary.motion import Motion

_INK = np.array([45, 52, 66], np.float32)
_MOST_COLUMNS = 4
Motions = Motion | Sequence[Motion]
Captions = str | Sequence[str] | None


def write_video(
    motions: Motions,
    path: str | os.PathLike,
    captions: Captions = None,
    fps: float | None = None,
    width: int = 480,
    height: int = 480,
    force: bool = True,
    progress: bool = False,
) -> Path:
    """Write an mp4 (H.264) or a gif of one motion or of several side by side.

    Args:
        motions: one or several; the video lasts as long as the longest.
        path: ends in .mp4 or .gif.
        captions: one for each motion.
        fps: of the video; by default the motions' own, at most 30 (gif: 20).
        width, height: pixels of each motion's panel.
        force: replace an existing file.
        progress: show a progress bar.

    Raises:
        InputError: see `write_motion`; also captions that do not match, or fps outside 1 to 120.
    """
    path = Path(path)
    gif = path.suffix.lower() == ".gif"
    motions, captions = _lists(motions, captions)
    if fps is None:
        fps = min(max(1.0, *(motion.fps for motion in motions)), 20.0 if gif else 30.0)
    if not 1 <= fps <= 120:
        raise InputError("fps", fps, "must be 1 to 120 frames per second")
    board = Board(motions, captions, width, height)
    count = max(1, round(max(motion.duration for motion in motions) * fps))
    frames = (board.draw(i / fps) for i in range(count))
    frames = tqdm(frames, total=count, unit="frame", desc=path.name, disable=not progress)
    with atomic_file(path, force) as temporary:
        try:
            _encode(frames, board.shape, fps, temporary, gif)
        except subprocess.SubprocessError as error:
            raise InputError(path, error, "cannot be written") from None
    return path


def render_frame(
    motions: Motions, seconds: float = 0.0, captions: Captions = None, width: int = 480, height: int = 480
) -> np.ndarray:
    """One moment as a picture (H, W, 3) uint8, drawn as in a video."""
    return Board(*_lists(motions, captions), width, height).draw(seconds)


def render_strip(
    motions: Motions,
    path: str | os.PathLike | None = None,
    captions: Captions = None,
    poses: int = 8,
    width: int = 130,
    height: int = 240,
    force: bool = True,
) -> np.ndarray:
    """Stills: a row per motion, in it `poses` moments from its first to its last frame, then its way over the ground
    from above (`draw_overhead`); a caption above each row.

    Args:
        motions: one or several.
        path: a .png to write, if given.
        captions: one for each motion.
        poses: moments per motion.
        width, height: pixels of each still, and of the way.

    Returns:
        (H, W, 3) uint8.

    Raises:
        InputError: fewer than one pose, another extension than .png, or a place that cannot be written.
    """
    motions, captions = _lists(motions, captions)
    if not 1 <= poses <= 64:
        raise InputError("poses", poses, "must be 1 to 64")
    rows = []
    for motion, caption in zip(motions, captions, strict=True):
        scene = Scene(motion, width, height, ground=False)
        moments = np.linspace(0, motion.frames - 1, poses)
        stills = [scene.draw(moment / motion.fps) for moment in moments]
        row = np.concatenate([*stills, draw_overhead(motion, moments, width, height)], axis=1)
        if caption:
            row = np.concatenate([_label(caption, row.shape[1], 17), row], axis=0)
        rows.append(row)
    picture = np.concatenate(rows, axis=0).clip(0, 255).astype(np.uint8)
    if path is not None:
        write_png(picture, path, force)
    return picture


def write_png(picture: np.ndarray, path: str | os.PathLike, force: bool = True) -> Path:
    """Write a picture (H, W, 3) uint8 as PNG, atomically."""
    from PIL import Image

    if Path(path).suffix.lower() != ".png":
        raise InputError(path, Path(path).suffix, "a picture's name must end in .png")
    with atomic_file(path, force) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG", optimize=True)
    return Path(path)


class Board:
    """Panels of motions in a grid, with captions below them; the whole has even sides, as H.264 wants."""

    def __init__(self, motions: Sequence[Motion], captions: Sequence[str], width: int, height: int):
        self.scenes = [Scene(motion, width, height) for motion in motions]
        self.canvases: list[np.ndarray | None] = [None] * len(motions)
        self.columns = min(len(motions), _MOST_COLUMNS)
        self.rows = -(-len(motions) // self.columns)
        labels = [_label(caption, width, max(13, width // 28)) if caption else None for caption in captions]
        band = max((len(label) for label in labels if label is not None), default=0)
        self.panel = (height + band, width)
        whole = self.rows * self.panel[0], self.columns * width
        self.shape = whole[0] + whole[0] % 2, whole[1] + whole[1] % 2
        self.base = np.full((*self.shape, 3), 255, np.uint8)
        for i, label in enumerate(labels):
            if label is not None:
                top, left = self._corner(i)
                self.base[top + height : top + height + len(label), left : left + width] = label

    def draw(self, seconds: float) -> np.ndarray:
        """The moment as (H, W, 3) uint8."""
        picture = self.base.copy()
        for i, scene in enumerate(self.scenes):
            top, left = self._corner(i)
            drawn = self.canvases[i] = scene.draw(seconds, self.canvases[i])
            # Values stay within 0..255 by construction: every step blends two colours.
            for channel in range(3):  # each lies by itself in what is drawn
                picture[top : top + drawn.shape[0], left : left + drawn.shape[1], channel] = drawn[..., channel]
        return picture

    def _corner(self, i: int) -> tuple[int, int]:
        return i // self.columns * self.panel[0], i % self.columns * self.panel[1]


def _lists(motions: Motions, captions: Captions) -> tuple[list[Motion], list[str]]:
    motions = [motions] if isinstance(motions, Motion) else list(motions)
    captions = [captions] if isinstance(captions, str) else list(captions or [""] * len(motions))
    if not motions:
        raise InputError("motions", "none", "at least one motion is needed")
    if len(captions) != len(motions):
        raise InputError("captions", f"{len(captions)} of them", f"one for each of {len(motions)} motions")
    return motions, captions


def _label(text: str, width: int, size: int) -> np.ndarray:
    """Centred dark text on white (H, width, 3) uint8, in at most three lines."""
    from PIL import Image, ImageDraw, ImageFont

    font: Any = ImageFont.load_default(size)
    letters = max(8, int((width - 16) / (font.getlength("abcdefghij nopqrstuvw") / 21)))
    lines = wrap(" ".join(text.split()), letters, max_lines=3, placeholder=" ...") or [""]
    step = int(size * 1.4)
    image = Image.new("RGB", (width, step * len(lines) + size // 2 + 4), (255, 255, 255))
    draw = ImageDraw.Draw(image)
    for i, line in enumerate(lines):
        left = (width - font.getlength(line)) / 2
        draw.text((left, 4 + i * step), line, font=font, fill=tuple(int(c) for c in _INK))
    return np.asarray(image)


def _encode(frames: Iterable[np.ndarray], shape: tuple[int, int], fps: float, path: Path, gif: bool) -> None:
    """Pipe frames (H, W, 3) uint8 through ffmpeg into `path`; OSError where the disk takes no more, SubprocessError
    where ffmpeg ends without the whole video, as when it is killed."""
    from imageio_ffmpeg import get_ffmpeg_exe

    command = [get_ffmpeg_exe(), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{shape[1]}x{shape[0]}", "-r", f"{fps:g}", "-i", "-", "-an"]
    if gif:  # a palette of the video's own colours
        split = "split[a][b];[a]palettegen=max_colors=128[p];[b][p]paletteuse=dither=bayer:bayer_scale=5"
        command += ["-filter_complex", split]
    else:
        command += ["-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-pix_fmt", "yuv420p"]
        command += ["-movflags", "+faststart", "-threads", "2"]
    said: list[bytes] = []
    with subprocess.Popen([*command, str(path)], stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        listener = threading.Thread(target=lambda: said.extend(process.stderr or ()), daemon=True)
        listener.start()  # no file: the disk for those may be full, too
        try:
            for frame in frames:
                process.stdin.write(frame.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            with suppress(BrokenPipeError):
                process.stdin.close()  # ffmpeg stopped; its own message says why
        except BaseException:
            process.kill()
            raise
        code = process.wait()
        listener.join()
    if code != 0:
        text = b" ".join(said).decode(errors="replace").strip()
        if number := _refusal(code, text):
            raise OSError(number, os.strerror(number))
        raise subprocess.SubprocessError(f"ffmpeg ended with {code}" + (f": {text}" if text else ""))


def _refusal(code: int, said: str) -> int | None:
    """The system's number of what kept ffmpeg from writing, by its exit code and words; None where it was another."""
    if code == -signal.SIGXFSZ:
        return errno.EFBIG
    return next((number for number in DISK_REFUSALS if os.strerror(number) in said), None)
