"""`Motion` checks what it is given."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.motion import Motion, Skeleton

SMPL = Skeleton.named("smpl22")
STILL = np.zeros((5, 22, 3), np.float32)
UNTURNED = np.tile(np.array([0, 0, 0, 1], np.float32), (5, 22, 1))


@pytest.mark.parametrize(
    "positions", [np.zeros((0, 22, 3)), np.zeros((5, 21, 3)), np.zeros((22, 3)), np.zeros((5, 22, 2)), "walk", None]
)
def test_wrong_shapes_are_refused(positions):
    with pytest.raises(InputError, match="positions"):
        Motion(positions, 20, SMPL)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_located(value):
    positions = STILL.copy()
    positions[3, 7, 1] = value
    with pytest.raises(InputError, match="frame 3, joint 7"):
        Motion(positions, 20, SMPL)


@pytest.mark.parametrize("fps", [0, -1, np.nan, np.inf, "fast", None])
def test_wrong_rates_are_refused(fps):
    with pytest.raises(InputError, match="fps"):
        Motion(STILL, fps, SMPL)


@pytest.mark.parametrize("rotations", [UNTURNED[:4], UNTURNED * 2, UNTURNED[..., :3], np.zeros_like(UNTURNED)])
def test_wrong_rotations_are_refused(rotations):
    with pytest.raises(InputError, match="rotations"):
        Motion(STILL, 20, SMPL, rotations)


def test_crop_keeps_rate_skeleton_and_rotations():
    motion = Motion(np.arange(5 * 66).reshape(5, 22, 3), 10, SMPL, UNTURNED)
    part = motion.crop(1, 4)
    assert (part.frames, part.fps, part.duration, part.skeleton) == (3, 10.0, 0.3, SMPL)
    np.testing.assert_array_equal(part.positions, motion.positions[1:4])
    assert part.rotations is not None
    assert part.positions.dtype == np.float32
    for span in ((3, 3), (-1, 2), (0, 6)):
        with pytest.raises(InputError, match="crop"):
            motion.crop(*span)


def test_whoever_imports_the_module_alone_can_save(tmp_path):
    """The writers are handed in without being loaded, and load when a motion is saved."""
    code = (
        "import sys\n"
        "from motionary.motion.motion import Motion\n"
        "from motionary.motion.skeleton import Skeleton\n"
        "assert 'motionary.formats' not in sys.modules\n"
        f"Motion([[[0.5] * 3] * 22] * 4, 20, Skeleton.named('smpl22')).save({str(tmp_path / 'a.npy')!r})\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), np.full((4, 22, 3), 0.5))
