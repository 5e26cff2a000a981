"""A motion of another rig among many: its own is found by name, ranked by distance, and short ones do not count."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.bench.recognized import main, recognized
from motionary.corpus.demo import demo_clip


class Heights:
    """Embeds a motion as the mean height of its joints, in metres."""

    def embed(self, motions, system):
        return np.array([[m.positions[..., 1].mean()] for m in motions])


@pytest.fixture
def files(tmp_path):
    for folder in ("rig", "mocap"):
        (tmp_path / folder).mkdir()
    made = [demo_clip(seed)[0].crop(0, 30) for seed in range(3)]
    for number, motion in enumerate(made):
        motion.save(tmp_path / f"mocap/{number:02d}.npz")
    made[0].crop(0, 10).save(tmp_path / "mocap/short.npz")
    made[1].save(tmp_path / "rig/other_01.npz")
    return tmp_path


def test_ranks_are_those_of_distances(files):
    among = [str(file) for file in sorted((files / "mocap").glob("*.npz"))]
    (row,) = recognized(Heights(), [str(files / "rig/other_01.npz")], among).rows
    assert row[:2] == ["other_01", "1 of 3"]
    assert row[2].startswith("01, ")
    assert "short" not in row[2]
    demo_clip(2)[0].crop(0, 30).save(files / "rig/wrong_01.npz")
    (row,) = recognized(Heights(), [str(files / "rig/wrong_01.npz")], among).rows
    assert row[1] in ("2 of 3", "3 of 3")
    assert row[2].startswith("02, ")


def test_a_file_without_a_counterpart_is_said(files, pipeline, capsys):
    line = [
        str(files / "rig/other_01.npz"),
        "--among",
        str(files / "mocap/00.npz"),
        "--models",
        str(pipeline / "models"),
    ]
    assert main(line) == 2
    assert "other_01.npz: 0 counterparts: must end with the name of exactly one file" in capsys.readouterr().err
