"""--onto: files of the shell on a character's own rig."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.cli import main
from motionary.corpus.demo import demo_clips
from motionary.formats import read_motion
from motionary.motion import Skeleton, fit_rotations, retarget


@pytest.fixture
def files(tmp_path):
    motion = fit_rotations(next(iter(demo_clips(1)))[0])
    motion.save(tmp_path / "walk.npz")
    smpl = Skeleton.named("smpl22")
    character = fit_rotations(retarget(motion, smpl.with_offsets(smpl.offsets * 0.8)))
    character.save(tmp_path / "character.bvh")
    character.save(tmp_path / "character.glb")
    return tmp_path, motion


@pytest.mark.parametrize("extension", ["bvh", "glb", "npz"])
def test_convert_writes_onto_a_rig(files, capsys, extension):
    folder, motion = files
    target = folder / f"out.{extension}"
    onto = folder / ("character.glb" if extension == "glb" else "character.bvh")
    assert main(["convert", str(folder / "walk.npz"), str(target), "--onto", str(onto)]) == 0
    assert capsys.readouterr().out.strip() == str(target)
    if extension == "glb":
        return
    found, wanted = (
        read_motion(target, skip_first=False) if extension == "bvh" else read_motion(target),
        motion.to(onto),
    )
    np.testing.assert_allclose(found.positions, wanted.positions, atol=1e-4)


def test_what_is_no_rig_is_said_in_one_line(files, capsys):
    folder, _ = files
    assert main(["convert", str(folder / "walk.npz"), str(folder / "out.bvh"), "--onto", str(folder / "walk.npz")]) == 2
    assert "must be a .bvh or .glb file" in capsys.readouterr().err
    assert not (folder / "out.bvh").exists()
