"""A folder of small synthetic clips, written afresh where a test needs one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.motion import Skeleton


def walk(frames: int, seed: int = 0, fps: float = 20.0) -> np.ndarray:
    """(T, 22, 3) a body that strolls and waves its joints a little; finite, smooth, about 1.7 m tall."""
    skeleton, rng = Skeleton.named("smpl22"), np.random.default_rng(seed)
    rest = np.zeros((len(skeleton.joints), 3))
    for joint, parent in enumerate(skeleton.parents):
        rest[joint] = skeleton.offsets[joint] + (rest[parent] if parent >= 0 else 0)
    rest[:, 1] -= rest[:, 1].min()
    time = np.arange(frames)[:, None, None] / fps
    sway = 0.05 * np.sin(2 * np.pi * (time * rng.uniform(0.5, 1.5, (1, 22, 1)) + rng.random((1, 22, 3))))
    path = np.zeros((frames, 1, 3))
    path[:, 0, 2] = rng.uniform(0.3, 1.2) * time[:, 0, 0]
    return (rest + sway * (np.arange(22) > 0)[:, None] + path).astype(np.float32)


def write_clips(root: Path, lines: list[dict], lengths: dict[str, int] | None = None) -> Path:
    """A folder with clips.jsonl; motions of 60 frames unless `lengths` says otherwise (0: not written)."""
    (root / "motions").mkdir(parents=True, exist_ok=True)
    for i, line in enumerate(lines):
        frames = (lengths or {}).get(line["motion"], 60)
        if frames:
            np.save(root / line["motion"], walk(frames, i))
    (root / "clips.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return root


def line(name: str, *texts: str, **labels) -> dict:
    """One line of clips.jsonl at 20 fps."""
    return {"motion": f"motions/{name}.npy", "fps": 20, "captions": [{"text": text} for text in texts]} | labels


@pytest.fixture
def motion_of():
    """walk(frames, seed, fps) -> (T, 22, 3)."""
    return walk


@pytest.fixture(scope="session")
def folder_of():
    """write_clips(root, lines, lengths) -> root."""
    return write_clips


@pytest.fixture(scope="session")
def some_clips(tmp_path_factory) -> Path:
    """24 captioned clips of two styles, three actions and four subjects, 3 s to 12 s, and four without captions."""
    lines = [
        line(
            f"clip{i:02d}",
            f"a person walks to the left {i} times",
            "somebody walks",
            style=("happy", "old")[i % 2],
            action=("walk", "run", "bow")[i % 3],
            subject=f"s{i % 4}",
        )
        for i in range(24)
    ] + [line(f"bare{i}") for i in range(4)]
    return write_clips(
        tmp_path_factory.mktemp("data") / "some", lines, {f"motions/clip{i:02d}.npy": 60 + 8 * i for i in range(24)}
    )


@pytest.fixture(scope="session")
def corpus(some_clips, tmp_path_factory) -> Corpus:
    """The clips of `some_clips`, preprocessed in this process."""
    out = tmp_path_factory.mktemp("built") / "corpus"
    preprocess({"source": "folder", "roots": [str(some_clips)], "workers": 1}, out, progress=False)
    return Corpus.open(out)
