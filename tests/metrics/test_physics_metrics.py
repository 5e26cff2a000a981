"""Skating, jitter and floor against motions built to have them."""

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.metrics import bone_change, floating, foot_skating, jitter, penetration
from motionary.metrics.physics import MEASURES, physics
from motionary.motion import Motion, Skeleton

SMPL = Skeleton.named("smpl22")


def standing(frames=40, fps=20.0):
    rest = np.zeros((22, 3))
    for joint, parent in enumerate(SMPL.parents):
        rest[joint] = SMPL.offsets[joint] + (rest[parent] if joint else 0)
    rest[:, 1] -= rest[:, 1].min()
    return Motion(np.repeat(rest[None], frames, axis=0), fps, SMPL)


def moved(motion, curve):
    """The motion with (T, 3) added to all joints."""
    return Motion(motion.positions + np.asarray(curve)[:, None], motion.fps, motion.skeleton)


@pytest.mark.parametrize("fps", [20.0, 60.0])
def test_a_sliding_body_skates_at_its_speed(fps):
    t = np.arange(40) / fps
    sliding = moved(standing(fps=fps), np.stack([0.3 * t, 0 * t, 0.4 * t], -1))
    assert foot_skating(sliding) == pytest.approx(0.5, rel=1e-3)
    assert foot_skating(standing(fps=fps)) == 0


def test_one_sliding_foot_counts_for_its_own_frames():
    motion = standing()
    p = motion.positions.copy()
    left = [SMPL.feet[0], SMPL.feet[1]]
    p[20:, left, 2] += (np.arange(20) * 0.02)[:, None]  # 0.4 m/s in half of the frames
    assert foot_skating(Motion(p, 20, SMPL)) == pytest.approx(0.4 * 19 / (2 * 39), rel=1e-3)


def test_a_lifted_foot_may_move():
    motion = standing()
    p = motion.positions.copy()
    left = [SMPL.feet[0], SMPL.feet[1]]
    p[20:, left, 1] += 0.2
    p[21:, left, 2] += (np.arange(19) * 0.05)[:, None]
    assert foot_skating(Motion(p, 20, SMPL)) == 0


def test_given_contacts_decide():
    t = np.arange(40) / 20
    sliding = moved(standing(), np.stack([t, 0 * t, 0 * t], -1))
    contacts = np.zeros((39, 4), bool)
    assert foot_skating(sliding, contacts=contacts) == 0
    contacts[:, 1] = True
    assert foot_skating(sliding, contacts=contacts) == pytest.approx(1, rel=1e-3)


def test_jerk_of_a_cubic_at_any_rate():
    for fps in (20.0, 50.0):
        t = np.arange(40) / fps
        cubic = moved(standing(fps=fps), np.stack([2 * t**3, 0 * t, t**2], -1))
        assert jitter(cubic) == pytest.approx(12, rel=0.02)


def test_floor():
    motion = standing()
    assert penetration(motion) == 0
    assert floating(motion) == 0
    sunk = moved(motion, np.repeat([[0, -0.03, 0]], 40, axis=0))
    assert penetration(sunk) == pytest.approx(0.03, rel=1e-4)
    up = np.zeros((40, 3))
    up[:10, 1] = 0.2
    assert floating(moved(motion, up)) == 0.25


def test_a_bone_that_stretches_counts_among_all_bones():
    motion = standing()
    assert bone_change(motion) == pytest.approx(0, abs=1e-7)
    p = motion.positions.copy()
    wrist = 20  # nothing hangs on it
    along = p[0, wrist] - p[0, SMPL.parents[wrist]]
    p[::2, wrist] += 0.04 * along / np.linalg.norm(along)  # 4 cm in every second frame: 2 cm from the mean in each
    stretched = Motion(p, 20, SMPL)
    assert bone_change(stretched) == pytest.approx(0.02 / 21, rel=1e-3)


def test_bones_do_not_change_where_the_body_turns_and_goes():
    turn = np.linspace(0, 2, 40)
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    p = standing().positions.astype(np.float64)
    turned = np.stack([c * p[..., 0] + s * p[..., 2], p[..., 1], c * p[..., 2] - s * p[..., 0]], -1)
    assert bone_change(moved(Motion(turned, 20, SMPL), np.stack([turn, turn, 0 * turn], -1))) < 1e-6


def test_every_measure_is_reported_and_a_statue_has_none_of_them():
    assert physics(standing()) == pytest.approx(dict.fromkeys(MEASURES, 0.0), abs=1e-6)


@pytest.mark.parametrize(
    "call",
    [
        lambda m: foot_skating(m.crop(0, 1)),
        lambda m: jitter(m.crop(0, 3)),
        lambda m: foot_skating(m, contacts=np.ones((3, 4))),
    ],
)
def test_bad_input_is_named(call):
    with pytest.raises(InputError):
        call(standing())


@pytest.mark.real
def test_real_feet_hardly_skate(shared_data):
    folder = shared_data / "styled" / "motions"
    clips = [Motion(np.load(p).astype(np.float32), 20, SMPL) for p in sorted(folder.glob("*walk*"))[::40]]
    real = np.mean([foot_skating(m) for m in clips])
    slides = [moved(m, np.arange(m.frames)[:, None] * np.array([0.02, 0, 0])) for m in clips]  # 0.4 m/s more
    assert real < 0.2
    assert np.mean([foot_skating(m) for m in slides]) > real + 0.2
