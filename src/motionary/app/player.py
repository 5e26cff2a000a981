"""What one visitor watches: several motions side by side, with one clock."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motionary.app.figures import LOOKS, Figure, Limbs
from motionary.app.limits import SPEEDS
from motionary.app.mannequins import Mannequins
from motionary.app.staging import places, smoothed, viewpoint, way_of
from motionary.motion import Motion

_TICK = 1 / 30
_TOLD = 0.25  # seconds between two reports of the time, which move the scrubber
_WORLD = "/shown"  # the node of all that moves past a visitor: figures and floor
_ABOVE = 0.2  # metres from a head to its title
_SAMPLED = 12  # poses of a motion that the view is fitted to


@dataclass(frozen=True)
class Item:
    """A motion that was asked for.

    Attributes:
        motion: to be shown.
        title: short, above the figure.
        text: what it is, in full; "" where the title says it.
        note: what else there is to say of it.
    """

    motion: Motion
    title: str
    text: str = ""
    note: str = ""

    @property
    def said(self) -> str:
        """What it is, in full."""
        return self.text or self.title


@dataclass
class _Shown:
    """An item in the scene, moved there by `shift` (3,).

    Attributes:
        way: (T, 3) its root's way over the floor, which the view follows.
        tops: (T,) heights of its head.
        label: its title.
    """

    motion: Motion
    shift: np.ndarray
    figure: Figure
    way: np.ndarray
    tops: np.ndarray
    label: Any
    frame: int = -1

    def frame_at(self, seconds: float) -> int:
        """The frame at a time; the last one stays."""
        return min(round(seconds * self.motion.fps), self.motion.frames - 1)

    def joints(self, frame: int) -> np.ndarray:
        """(J, 3) in the scene."""
        return self.motion.positions[frame] + self.shift

    def pose(self, frame: int) -> None:
        """Moves to a frame."""
        if frame != self.frame:
            self.figure.pose(frame)
            self.label.position = self.way[frame] + [0, self.tops[frame] + _ABOVE, 0]
            self.frame = frame


class Player:
    """Plays items in a scene. Its clock runs in a thread that ends with :meth:`close`.

    What a visitor does to the clock or the camera returns at once and is shown at the next tick: to build figures of
    long motions takes seconds, and the threads that bring the visitors' clicks are shared by all. The view follows by
    moving the world, not the camera, which stays the visitor's.

    Attributes:
        items: what is shown.
        seconds, speed, playing: the clock.
        look: one of `LOOKS`.
        follow: whether the middle of the figures stays where it is, and the floor moves.
    """

    def __init__(self, client: Any, told: Callable[[float], None]):
        """`told` is called with the seconds while the clock runs."""
        self.items: tuple[Item, ...] = ()
        self.seconds, self.speed, self.playing, self.look, self.follow = 0.0, 1.0, True, LOOKS[0], True
        self._client, self._told = client, told
        self._world = client.scene.add_frame(_WORLD, show_axes=False)
        client.scene.add_grid(f"{_WORLD}/floor", width=30, height=30, plane="xz", cell_size=0.5, section_size=2.0)
        self._mannequins = Mannequins(client.scene, _WORLD)
        self._shown: list[_Shown] = []
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
        """Shows the same in another look."""
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

    def set_follow(self, follow: bool) -> None:
        """Holds the middle of the figures, or the floor, where it is."""
        self.follow, self._recentre = follow, True

    def look_at_all(self) -> None:
        """Puts the camera where it sees every motion, from beginning to end."""
        self._recentre = True

    def close(self) -> None:
        """Ends the clock's thread."""
        self._closed.set()

    def _look_at_all(self) -> None:
        if not self._shown:
            return
        camera = self._client.camera
        position, target = viewpoint(self._points(), camera.fov, camera.image_width, camera.image_height)
        with self._client.atomic():
            camera.up_direction = (0.0, 1.0, 0.0)
            camera.position, camera.look_at = position, target

    def _points(self) -> np.ndarray:
        """(N, 3) where joints and titles come to be before the camera."""
        found = []
        for seconds in np.linspace(0, self.duration, _SAMPLED):
            middle = self._middle(seconds) if self.follow else self._middle(0.0)
            for shown in self._shown:
                frame = shown.frame_at(seconds)
                top = shown.way[frame] + [0, shown.tops[frame] + 2 * _ABOVE, 0]
                found.append(np.concatenate([shown.joints(frame), top[None]]) - middle)
        return np.concatenate(found)

    def _middle(self, seconds: float) -> np.ndarray:
        """(3,) of all figures on the floor, without their sway."""
        return np.mean([shown.way[shown.frame_at(seconds)] for shown in self._shown], axis=0)

    def _build(self) -> None:
        self._round += 1  # names are new: a message to a node that is gone cannot reach its successor
        with self._client.atomic():
            for shown in self._shown:
                shown.figure.remove()
                shown.label.remove()
            self._shown = []
            shifts = places([item.motion for item in self.items])
            self._shown = [self._stage(i, self.items[i], shift) for i, shift in enumerate(shifts)]
            self._pose()

    def _stage(self, index: int, item: Item, shift: np.ndarray) -> _Shown:
        name = f"{_WORLD}/{self._round}/{index}"
        way = way_of(item.motion, shift)
        tops = smoothed(item.motion.positions[..., 1].max(1, keepdims=True) + shift[1], item.motion.fps)[:, 0]
        label = self._client.scene.add_label(f"{name}/title", item.title, anchor="bottom-center")
        return _Shown(item.motion, shift, self._figure(name, item.motion, shift), way, tops, label)

    def _figure(self, name: str, motion: Motion, shift: np.ndarray) -> Figure:
        """A motion in the look that is chosen; a rig that no mannequin fits is shown as its skeleton."""
        dressed = self._mannequins.take(motion, shift) if self.look == "mannequin" else None
        return dressed or Limbs(self._client.scene, name, motion, shift)

    def _pose(self) -> None:
        with self._client.atomic():
            for shown in self._shown:
                shown.pose(shown.frame_at(self.seconds))
            if self._shown:
                self._world.position = -self._middle(self.seconds if self.follow else 0.0)

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
            if not (self.playing and self._shown and self.duration > 0):
                return False
            self.seconds = (self.seconds + seconds * self.speed) % self.duration
            return True
