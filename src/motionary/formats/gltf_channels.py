"""What a glTF animation does to its nodes: keys of each channel, the rate that they were made at, values at frames.

Reference: Khronos, glTF 2.0 specification, 3.11 and appendix C (interpolation).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from motionary.formats.gltf_file import GltfFile
from motionary.motion.motion import FASTEST_RATE, SLOWEST_RATE
from motionary.motion.rotations import quat_continuation, unitquat_slerp

WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
_LINEAR, _STEP, _CUBIC = "LINEAR", "STEP", "CUBICSPLINE"
_NEAR = 0.02  # of a frame, by which times of float32 may be off
_USUAL = 30.0  # frames per second, where keys tell none
_SLOW = 10.0  # keys that are rarer are set by hand, and between them lie frames


@dataclass(frozen=True)
class Channel:
    """One animated property of a node.

    Attributes:
        path: "translation", "rotation" or "scale".
        times: (n,) of its keys, seconds, rising.
        values: (n, width); of CUBICSPLINE (n, 3, width): tangent in, value, tangent out.
        how: LINEAR, STEP or CUBICSPLINE.
    """

    path: str
    times: np.ndarray
    values: np.ndarray
    how: str

    def at(self, times: np.ndarray, rate: float) -> np.ndarray:
        """(T, width) values at times that lie 1 / rate apart, held before the first key and after the last."""
        keys = self.values[:, 1] if self.how == _CUBIC else self.values
        place = (self.times - times[0]) * rate
        whole = np.round(place)
        place = np.where(np.abs(place - whole) < _NEAR, whole, place)
        frames = np.arange(len(times), dtype=np.float64)
        if len(place) == len(frames) and np.array_equal(place, frames):
            found = keys
        else:
            found = self._between(keys, place, np.clip(frames, place[0], place[-1]), rate)
        if self.path == "rotation":
            found = found / np.maximum(np.linalg.norm(found, axis=-1, keepdims=True), 1e-9)
        return found

    def _between(self, keys: np.ndarray, place: np.ndarray, frames: np.ndarray, rate: float) -> np.ndarray:
        """Values at frames that lie among the keys' places."""
        if len(keys) == 1:
            return np.repeat(keys, len(frames), axis=0)
        before = np.clip(np.searchsorted(place, frames, side="right") - 1, 0, len(keys) - 2)
        length = np.maximum(place[before + 1] - place[before], 1e-9)
        share = np.clip((frames - place[before]) / length, 0, 1)
        if self.how == _STEP:
            return np.where((share < 1)[:, None], keys[before], keys[before + 1])
        if self.how == _CUBIC:
            s, seconds = share[:, None], (length / rate)[:, None]
            start, end = self.values[before], self.values[before + 1]
            return (
                (2 * s**3 - 3 * s**2 + 1) * start[:, 1]
                + (s**3 - 2 * s**2 + s) * seconds * start[:, 2]
                + (3 * s**2 - 2 * s**3) * end[:, 1]
                + (s**3 - s**2) * seconds * end[:, 0]
            )
        if self.path == "rotation":
            return unitquat_slerp(keys[before][:, None], keys[before + 1][:, None], share)[:, 0]
        return keys[before] + share[:, None] * (keys[before + 1] - keys[before])


def channels_of(file: GltfFile, animation: dict[str, Any], where: str) -> dict[tuple[int, str], Channel]:
    """The channels of an animation by node and path; what moves weights of a mesh is left aside.

    Raises:
        InputError: a wrong index, keys that do not rise, or values that do not fit them.
    """
    samplers = file.entries("samplers", animation, f"{where}, ")
    found: dict[tuple[int, str], Channel] = {}
    read: dict[tuple[int, str], Channel] = {}  # by sampler: several nodes may share one
    for i, entry in enumerate(file.entries("channels", animation, f"{where}, ")):
        what, target = f"{where}, channel {i}", entry.get("target")
        if not isinstance(target, dict):
            raise file.wrong(what, target, "must have a target")
        path = target.get("path")
        if "node" not in target or not isinstance(path, str) or path not in WIDTHS:
            continue
        node = file.index(target["node"], len(file.nodes), f"{what}, node")
        if (node, path) in found:
            raise file.wrong(what, f"{path} of node {node}", "each property of a node has one channel")
        at = file.index(entry.get("sampler"), len(samplers), f"{what}, sampler")
        if (at, path) not in read:
            read[at, path] = _channel(file, samplers[at], path, what)
        found[node, path] = read[at, path]
    return found


def _channel(file: GltfFile, sampler: dict[str, Any], path: str, what: str) -> Channel:
    how = sampler.get("interpolation", _LINEAR)
    if how not in (_LINEAR, _STEP, _CUBIC):
        raise file.wrong(f"{what}, interpolation", how, f"must be {_LINEAR}, {_STEP} or {_CUBIC}")
    times = file.accessor(sampler.get("input"), 1, f"{what}, input")[:, 0]
    if not len(times) or (np.diff(times) < 0).any() or times[0] < 0:
        raise file.wrong(f"{what}, input", f"{len(times)} times", "must be seconds from 0 on that rise")
    values = file.accessor(sampler.get("output"), WIDTHS[path], f"{what}, output")
    if len(values) != len(times) * (3 if how == _CUBIC else 1):
        raise file.wrong(f"{what}, output", f"{len(values)} values", f"must be those of {len(times)} keys")
    if how == _CUBIC:
        values = values.reshape(len(times), 3, -1)
    if path == "rotation":
        turns = values[:, 1] if how == _CUBIC else values
        if (np.abs(np.linalg.norm(turns, axis=-1) - 1) > 0.05).any():
            raise file.wrong(f"{what}, output", "other lengths", "rotations must be unit quaternions")
        if how == _LINEAR:
            values = quat_continuation(values)
    return Channel(path, times, values, how)


def rate_of(channels: Iterable[Channel]) -> float:
    """Frames per second at which the keys lie; of keys set by hand a multiple of theirs, so that each is a frame."""
    steps = [np.diff(channel.times) for channel in channels]
    together = np.concatenate([step[step > 0] for step in steps] or [np.empty(0)])
    if not len(together):
        return _USUAL
    # Times are float32: a mean over many keys is exact where a single step is not.
    longest = max(steps, key=len)
    even = len(longest) > 1 and np.ptp(longest) < 0.1 * longest.mean()
    step = float(longest.mean()) if even else float(np.percentile(together, 5))
    if not even and (np.abs(together / step - np.round(together / step)) > 0.1).mean() > 0.05:
        return _USUAL
    rate = 1 / step
    if round(rate) and abs(rate / round(rate) - 1) < 5e-4:
        rate = float(round(rate))
    if rate < _SLOW:
        rate *= np.ceil(_USUAL / rate)
    return float(np.clip(rate, SLOWEST_RATE, FASTEST_RATE))
