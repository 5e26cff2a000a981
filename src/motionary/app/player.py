"""What one visitor watches: several motions side by side, with one clock."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motionary.app.figures import Figure, make_figure
from motionary.app.limits import SPEEDS
from motionary.motion import Motion

_TICK = 1 / 30
_GAP = 0.5  # metres between neighbours
_TOLD = 0.25  # seconds between two reports of the time, which move the scrubber


@dataclass(frozen=True)
class Item:
    """A motion and what stands above it."""

    motion: Motion
    title: str


class Player:
    """Plays items in a scene. Its clock runs in a thread that ends with :meth:`close`.

    What a visitor does to the clock or the camera returns at once and is shown at the next tick: to build figures of
    long motions takes seconds, and the threads that bring the visitors' clicks are shared by all.

    Attributes:
        items: what is shown.
        seconds, speed, playing: the clock.
        look: "skeleton" or "mannequin".
    """

    def __init__(self, client: Any, told: Callable[[float], None]):
        """`told` is called with the seconds while the clock runs."""
        self.items: tuple[Item, ...] = ()
        self.seconds, self.speed, self.playing, self.look = 0.0, 1.0, True, "skeleton"
        self._client, self._told = client, told
        self._figures: list[tuple[Figure, Motion]] = []
        self._labels: list[Any] = []
        self._shown: list[int] = []
        self._round, self._recentre = 0, False
        self._lock, self._closed = threading.RLock(), threading.Event()
        self._time = threading.Lock()  # of the clock's values; only ever held for a moment
        threading.Thread(target=self._run, daemon=True, name="player").start()

    @property
    def duration(self) -> float:
        """Of the longest motion, in seconds."""
        return max((item.motion.frames - 1) / item.motion.fps for item in self.items) if self.items else 0.0

    def show(self, items: Sequence[Item]) -> None:
        """Replaces what is shown and starts again."""
        with self._lock:
            self.items = tuple(items)
            self.seek(0.0)
            self._build()
            self._look_at_all()

    def set_look(self, look: str) -> None:
        """Shows the same as skeletons or mannequins."""
        with self._lock:
            self.look = look
            self._build()

    def seek(self, seconds: float) -> None:
        """Moves the clock; to the beginning or the end where the motions have no such moment."""
        with self._time:
            self.seconds = min(max(seconds, 0.0), self.duration) if math.isfinite(seconds) else 0.0

    def set_speed(self, speed: float) -> None:
        """Seconds of motion per second, within `SPEEDS`."""
        with self._time:
            self.speed = min(max(speed, SPEEDS[0]), SPEEDS[1]) if math.isfinite(speed) else 1.0

    def look_at_all(self) -> None:
        """Puts the camera where it sees every motion from its beginning."""
        self._recentre = True

    def _look_at_all(self) -> None:
        with self._lock:
            places = _places([item.motion for item in self.items])
            points = [m.positions[:, 0] + shift for m, shift in zip(self._motions(), places, strict=True)]
            low, high = (f(np.concatenate(points), axis=0) if points else np.zeros(3) for f in (np.min, np.max))
            middle = (low + high) / 2 * [1, 0, 1] + [0, 0.9, 0]
            away = max(3.2, 1.0 * (high[0] - low[0]) + 2.4, 0.9 * (high[2] - low[2]) + 2.4)
            camera = self._client.camera
            with self._client.atomic():
                camera.up_direction = (0.0, 1.0, 0.0)
                camera.position = middle + np.array([0.35, 0.28, 1.0]) * away + [0, 0, (high[2] - low[2]) / 2]
                camera.look_at = middle

    def close(self) -> None:
        """Ends the clock's thread."""
        self._closed.set()

    def _motions(self) -> list[Motion]:
        return [item.motion for item in self.items]

    def _build(self) -> None:
        scene = self._client.scene
        self._round += 1  # names are new: a message to a node that is gone cannot reach its successor
        with self._client.atomic():
            for figure, _ in self._figures:
                figure.remove()
            for label in self._labels:
                label.remove()
            self._figures, self._labels, self._shown = [], [], []
            for i, (item, shift) in enumerate(zip(self.items, _places(self._motions()), strict=True)):
                name = f"/shown{self._round}/{i}"
                figure = make_figure(scene, name, item.motion, shift, self.look)
                self._figures.append((figure, item.motion))
                top = item.motion.positions[0, :, 1].max() + shift[1] + 0.3
                where = item.motion.positions[0, 0] + shift
                self._labels.append(
                    scene.add_label(
                        f"{name}/title", item.title, position=(where[0], top, where[2]), anchor="bottom-center"
                    )
                )
            self._shown = [-1] * len(self._figures)
            self._pose()

    def _pose(self) -> None:
        with self._client.atomic():
            for i, (figure, motion) in enumerate(self._figures):
                frame = min(round(self.seconds * motion.fps), motion.frames - 1)
                if frame != self._shown[i]:
                    figure.pose(frame)
                    self._shown[i] = frame

    def _run(self) -> None:
        last = told = time.monotonic()
        while not self._closed.wait(_TICK):
            now = time.monotonic()
            with self._lock:
                if self._recentre:
                    self._recentre = False
                    self._look_at_all()
                moved = self._advance(now - last)
                self._pose()
                if moved and now - told > _TOLD:
                    told = now
                    self._told(self.seconds)
            last = now

    def _advance(self, seconds: float) -> bool:
        """Lets the clock run; whether it does."""
        with self._time:
            if not (self.playing and self._figures and self.duration > 0):
                return False
            self.seconds = (self.seconds + seconds * self.speed) % self.duration
            return True


def _places(motions: Sequence[Motion]) -> list[np.ndarray]:
    """How far to move each motion (3,) so that all stand on the floor, side by side from left to right."""
    widths, places, left = [], [], 0.0
    for motion in motions:
        low, high = (f(motion.positions, axis=(0, 1)) for f in (np.min, np.max))
        places.append(np.array([left - low[0], -low[1], -motion.positions[0, 0, 2]], np.float64))
        widths.append(float(high[0] - low[0]))
        left += widths[-1] + _GAP
    return [place - [(left - _GAP) / 2, 0, 0] for place in places]
