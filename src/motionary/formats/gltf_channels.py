"""What a glTF animation does to its nodes: keys of each channel, the rate that they were made at, values at frames.

Reference: Khronos, glTF 2.0 specification, 3.11 and appendix C (interpolation).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.formats.gltf_file import GltfFile
from motionary.formats.read.extent import SMALL
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


@dataclass(frozen=True)
class KeySource:
    """Where the keys of a channel lie.

    Attributes:
        what: names the channel in errors.
        sampler: of the document.
    """

    what: str
    sampler: dict[str, Any]


def sources_of(file: GltfFile, animation: dict[str, Any], where: str) -> dict[tuple[int, str], KeySource]:
    """The channels of an animation by node and path; what moves weights of a mesh is left aside.

    Raises:
        InputError: a wrong index, or a second channel for what has one.
    """
    samplers = file.entries("samplers", animation, f"{where}, ")
    found: dict[tuple[int, str], KeySource] = {}
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
        found[node, path] = KeySource(
            what, samplers[file.index(entry.get("sampler"), len(samplers), f"{what}, sampler")]
        )
    return found


def channels_of(file: GltfFile, sources: Mapping[tuple[int, str], KeySource]) -> dict[tuple[int, str], Channel]:
    """The keys of channels by node and path. What several share is read once.

    Raises:
        InputError: keys that do not rise, values that do not fit them, or more of them than the file has room for.
    """
    clocks: dict[int, np.ndarray] = {}
    read: dict[tuple[int, int, str, str], Channel] = {}
    found: dict[tuple[int, str], Channel] = {}
    count, total = len(file.entries("accessors")), 0
    for (node, path), source in sources.items():
        what, how = source.what, source.sampler.get("interpolation", _LINEAR)
        if how not in (_LINEAR, _STEP, _CUBIC):
            raise file.wrong(f"{what}, interpolation", how, f"must be {_LINEAR}, {_STEP} or {_CUBIC}")
        clock, output = (file.index(source.sampler.get(key), count, f"{what}, {key}") for key in ("input", "output"))
        if clock not in clocks:
            clocks[clock] = _clock(file, clock, f"{what}, input")
            total += len(clocks[clock])
        key = (clock, output, path, how)
        if key not in read:
            read[key] = Channel(path, clocks[clock], _values(file, output, path, how, len(clocks[clock]), what), how)
            total += len(read[key].values)
        if total > (most := max(SMALL, file.size // 2)):  # each takes bytes, of which none must be those of many
            raise InputError(file.path, f"{total:,} keys", f"a file of {file.size:,} bytes may have {most:,}")
        found[node, path] = read[key]
    return found


def _clock(file: GltfFile, index: int, what: str) -> np.ndarray:
    """(n,) times of keys."""
    times = file.accessor(index, 1, what)[:, 0]
    if not len(times) or (np.diff(times) < 0).any() or times[0] < 0:
        raise file.wrong(what, f"{len(times)} times", "must be seconds from 0 on that rise")
    return times


def _values(file: GltfFile, index: int, path: str, how: str, keys: int, what: str) -> np.ndarray:
    """Of so many keys; see `Channel`."""
    values = file.accessor(index, WIDTHS[path], f"{what}, output")
    if len(values) != keys * (3 if how == _CUBIC else 1):
        raise file.wrong(f"{what}, output", f"{len(values)} values", f"must be those of {keys} keys")
    if how == _CUBIC:
        values = values.reshape(keys, 3, -1)
    if path == "rotation":
        turns = values[:, 1] if how == _CUBIC else values
        if (np.abs(np.linalg.norm(turns, axis=-1) - 1) > 0.05).any():
            raise file.wrong(f"{what}, output", "other lengths", "rotations must be unit quaternions")
        if how == _LINEAR:
            values = quat_continuation(values)
    return values


def rate_of(channels: Iterable[Channel]) -> float:
    """Frames per second at which the keys lie; of keys set by hand a multiple of theirs, so that each is a frame."""
    clocks = {id(channel.times): channel.times for channel in channels}  # most channels share one
    steps = [np.diff(times) for times in clocks.values()]
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
