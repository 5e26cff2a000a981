"""The oracle on motions drawn by formula, and its indifference to place, facing, rate and rig."""

import dataclasses

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.motion import Motion, Skeleton, mirror, resample
from motionary.oracle import Attributes, confirm, read
from motionary.oracle.episodes import episodes, reversals

SMPL = Skeleton.named("smpl22")
FPS = 20.0
R = {name: joint for joint, name in enumerate(SMPL.joints)}


def body(seconds=4.0):
    """Positions (T, 22, 3) of somebody who stands with hanging arms, facing +z, and the times (T,)."""
    p = np.zeros((22, 3))
    for joint, parent in enumerate(SMPL.parents):
        p[joint] = SMPL.offsets[joint] + (p[parent] if joint else 0)
    for side in ("left", "right"):
        hang(p, side, [0, -1, 0])
    p[:, 1] -= p[:, 1].min()
    t = np.arange(round(seconds * FPS)) / FPS
    return np.repeat(p[None], len(t), axis=0), t


def hang(p, side, direction):
    """Point a straight arm, (..., 22, 3) in place."""
    d = np.asarray(direction, float)
    d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    for joint, length in (("elbow", 0.25), ("wrist", 0.5)):
        p[..., R[f"{side}_{joint}"], :] = p[..., R[f"{side}_shoulder"], :] + length * d


def motion(p):
    return Motion(p, FPS, SMPL)


def leg(p, side, direction, share=1.0):
    """Point a straight leg of `share` of its length, in place."""
    d = np.asarray(direction, float)
    d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    for joint, length in (("knee", 0.4), ("ankle", 0.8), ("foot", 0.85)):
        p[..., R[f"{side}_{joint}"], :] = p[..., R[f"{side}_hip"], :] + share * length * d


def walking(speed, way=(0, 0, 1), cadence=1.8, lift=0.0, seconds=4.0):
    """A walk with swinging legs along a fixed direction while facing +z."""
    p, t = body(seconds)
    phase = np.pi * cadence * t
    for side, sign in (("left", 1), ("right", -1)):
        swing = 0.45 * np.sin(phase) * sign
        leg(p, side, np.stack([0 * t, -np.cos(swing), np.sin(swing)], -1))
    p[..., 1] += np.maximum(0, np.sin(2 * phase))[:, None] * lift
    return p + (t[:, None] * speed * np.asarray(way, float))[:, None]


def raising(side, seconds=4.0):
    p, t = body(seconds)
    angle = np.pi * np.clip(np.minimum(t, seconds - t) / 1.0, 0, 1)
    hang(p, side, np.stack([0.3 * (1 if side == "left" else -1) + 0 * t, -np.cos(angle), np.sin(angle)], -1))
    return p


def waving(side):
    p = raising(side)
    t = np.arange(len(p)) / FPS
    up = (t > 1) & (t < 3)
    p[up, R[f"{side}_wrist"], 0] += 0.12 * np.sin(2 * np.pi * 2 * t[up])
    return p


def turn(p, angles):
    """Turn the body about its first place by angles (T,) to the left."""
    c, s = np.cos(angles), np.sin(angles)
    x, z = p[..., 0].copy(), p[..., 2].copy()
    p[..., 0] = c[:, None] * x + s[:, None] * z
    p[..., 2] = -s[:, None] * x + c[:, None] * z
    return p


def test_standing_still_shows_nothing():
    a = read(motion(body()[0]))
    assert (a.raised, a.waving, a.gait, a.direction, a.turned) == ("none", "none", "still", "none", "none")
    counts = [v for f in dataclasses.fields(Attributes) if isinstance(v := getattr(a, f.name), int)]
    assert counts
    assert not any(counts)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_hand_rises_or_waves(side):
    raised, waved = read(motion(raising(side))), read(motion(waving(side)))
    assert (raised.raised, raised.above_head, raised.waving) == (side, side, "none")
    assert (waved.raised, waved.waving) == (side, side)
    assert getattr(raised, f"raises_{side}") == 1


def test_both_hands():
    p = raising("left")
    right = R["right_elbow"], R["right_wrist"]
    p[:, right] = raising("right")[:, right]
    assert read(motion(p)).raised == "both"


@pytest.mark.parametrize(
    ("way", "direction"),
    [((0, 0, 1), "forward"), ((0, 0, -1), "backward"), ((1, 0, 0), "left"), ((-1, 0, 0), "right")],
)
def test_walking_goes_where_it_goes(way, direction):
    a = read(motion(walking(1.0, way)))
    assert (a.gait, a.direction) == ("walk", direction)
    assert a.distance == pytest.approx(3.95, abs=0.35)  # smoothing takes a little off both ends
    np.testing.assert_allclose(a.displacement, (way[0] * 3.95, way[2] * 3.95), atol=0.4)
    assert a.speed == pytest.approx(1, rel=0.05)


def test_running_is_fast_and_flies():
    assert read(motion(walking(3.2, cadence=2.7, lift=0.08))).gait == "run"


@pytest.mark.parametrize(("degrees", "side"), [(100, "left"), (-100, "right"), (20, "none")])
def test_turns(degrees, side):
    p, t = body()
    a = read(motion(turn(p, np.radians(degrees) * np.clip(t - 1, 0, 1))))
    assert a.turned == side
    assert a.turn == pytest.approx(degrees, abs=3)


def test_jumps_are_counted():
    p, t = body(6)
    for start in (1.0, 2.5, 4.0):
        air = (t > start) & (t < start + 0.5)
        s = (t[air] - start) / 0.5
        p[air, :, 1] += (1.2 * s * (1 - s))[:, None]
    a = read(motion(p))
    assert (a.jumps, a.hops_left, a.hops_right) == (3, 0, 0)


def test_hops_belong_to_the_leg_that_lands():
    p, t = body(4)
    leg(p, "right", [0, -0.6, -0.5], share=0.8)
    for start in (1.0, 2.0):
        air = (t > start) & (t < start + 0.4)
        s = (t[air] - start) / 0.4
        p[air, :, 1] += (0.6 * s * (1 - s))[:, None]
    a = read(motion(p))
    assert (a.hops_left, a.hops_right, a.jumps) == (2, 0, 0)


def test_squats_go_down_over_the_feet():
    p, t = body(6)
    depth = 0.42 * np.maximum(0, np.sin(np.pi * t / 1.5)) ** 2 * (t < 4.5)
    feet = [R[f"{side}_{joint}"] for side in ("left", "right") for joint in ("ankle", "foot")]
    others = [joint for joint in range(22) if joint not in feet]
    p[:, others, 1] -= depth[:, None]
    a = read(motion(p))
    assert (a.squats, a.sits) == (2, 0)


def test_kicks():
    p, t = body(4)
    for start in (0.5, 2.0):
        during = (t >= start) & (t < start + 1)
        angle = np.radians(80) * np.sin(np.pi * (t[during] - start))
        straight = p[during]
        leg(straight, "right", np.stack([0 * angle, -np.cos(angle), np.sin(angle)], -1))
        p[during] = straight
    a = read(motion(p))
    assert (a.kicks_left, a.kicks_right) == (0, 2)


def test_bows():
    p, t = body(4)
    angle = np.radians(60) * np.sin(np.pi * t / 2) ** 2
    upper = [R[n] for n in R if not any(part in n for part in ("hip", "knee", "ankle", "foot", "pelvis"))]
    rel = p[:, upper] - p[:, :1]
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    p[:, upper, 1] = p[:, :1, 1] + c * rel[..., 1] - s * rel[..., 2]
    p[:, upper, 2] = p[:, :1, 2] + s * rel[..., 1] + c * rel[..., 2]
    a = read(motion(p))
    assert (a.bows, a.squats) == (2, 0)


@pytest.mark.parametrize("build", [lambda: waving("left"), lambda: walking(1.0, (1, 0, 0)), lambda: walking(3.2)])
def test_place_facing_and_rate_do_not_matter(build):
    m = motion(build())
    words = ("raised", "waving", "gait", "direction", "turned", "jumps", "squats")
    expected = [getattr(read(m), w) for w in words]
    elsewhere = motion(turn(m.positions.astype(float), np.full(m.frames, 2.2)) + np.array([3, 0, -7]))
    for other in (elsewhere, resample(m, 30), resample(m, 12.5)):
        assert [getattr(read(other), w) for w in words] == expected


def test_mirroring_swaps_sides():
    assert read(mirror(motion(waving("left")))).waving == "right"
    assert read(mirror(motion(walking(1.0, (1, 0, 0))))).direction == "right"


def test_small_noise_does_not_wave():
    noise = np.random.default_rng(0).normal(0, 0.01, (80, 22, 3))
    assert read(motion(raising("left") + noise)).waving == "none"


@pytest.mark.parametrize("frames", [1, 2, 3, 5])
def test_short_motions_are_read(frames):
    assert read(motion(walking(1.0)[:frames])).jumps == 0


def test_a_rig_without_limbs_is_refused():
    stick = Skeleton.from_rig("stick", ["root", "tip"], [-1, 0], np.array([[0, 0, 0], [0, 1, 0]]))
    with pytest.raises(InputError, match="left_ankle"):
        read(Motion(np.zeros((5, 2, 3)), 20, stick))


def test_confirm():
    m = motion(raising("left"))
    assert confirm(m, "a person raises the left hand") is True
    assert confirm(m, "a person raises the right hand") is False
    assert confirm(m, {"raised": "left", "raises_left": (1, 2)}) is True
    assert confirm(m, "somebody thinks") is None


def test_episodes_need_to_come_back():
    x = np.array([0, 2, 1, 2, 0, 2, 0.0])
    assert episodes(x, 1.5, 0.5) == 2
    assert episodes(x, 5, 0.5) == 0
    assert reversals(np.array([1, -1, 1, 0.1, -0.1, 1, -1]), 0.5) == 3
