"""Which way is up, what is left and how long a unit is: people in any posture, as other programs write them."""

from __future__ import annotations

import json
import os
import warnings

import numpy as np
import pytest
from postures import POSTURES, SMPL, person, points, rest_frames, restless, turn, written
from turned import ONTO, RESTS, SCALES, Case, cases

from motionary.errors import InputError, InputWarning
from motionary.formats import read_motion
from motionary.formats.measure import AXES, body_of
from motionary.formats.measure.up import _falls
from motionary.formats.read import read_motion_with
from motionary.motion import Motion
from motionary.motion.rotations import quat_action, quat_conjugation, quat_product

CLIPS = int(os.environ.get("MOTIONARY_CLIPS", "24"))  # `make measured` takes all 200


@pytest.mark.parametrize("rest", RESTS)
@pytest.mark.parametrize("posture", POSTURES)
def test_people_in_any_posture_are_put_upright_as_they_were(tmp_path, posture, rest):
    world, root = person(posture)
    for up in ("y", "z", "-y"):
        path = tmp_path / "a.bvh"
        path.write_text(written(world, root, up, rest))
        motion, reading = read_motion_with(path)
        assert reading.up == up or reading.notes, (up, reading)
        if posture not in ("lies on the back", "lies on the belly"):
            assert reading.up == up
        if reading.up == up:
            np.testing.assert_allclose(motion.positions, points(world, root), atol=2e-3)
        told, _ = read_motion_with(path, up=up)
        np.testing.assert_allclose(told.positions, points(world, root), atol=2e-3)


@pytest.mark.parametrize("rest", RESTS)
def test_rotations_stay_true_when_rest_pose_and_world_turn(tmp_path, rest):
    """Forward kinematics of what was read is where the joints are, whatever turned."""
    from motionary.motion import forward_kinematics

    world, root = person("bows")
    for up in ONTO:
        path = tmp_path / "a.bvh"
        path.write_text(written(world, root, up, rest))
        for mirror in (False, True):
            motion, _ = read_motion_with(path, up=up, mirror=mirror)
            assert motion.rotations is not None
            again = forward_kinematics(motion.skeleton, motion.rotations, motion.positions[:, 0])
            np.testing.assert_allclose(again, motion.positions, atol=1e-3)
            expected = points(world, root) * ([-1, 1, 1] if mirror else 1)
            np.testing.assert_allclose(motion.positions, expected, atol=2e-3)


@pytest.mark.parametrize("size", [0.6, 0.75, 1.0, 1.15])
@pytest.mark.parametrize("unit", SCALES)
def test_children_and_adults_in_any_unit(tmp_path, size, unit):
    """A child of 1.05 m, one of 1.3 m, and adults; a child in decimetres or inches may be doubted, never in silence."""
    world, root = person("stands")
    positions = points(world, root) * size
    np.save(tmp_path / "a.npy", positions * SCALES[unit])
    motion, reading = read_motion_with(tmp_path / "a.npy")
    assert reading.unit == pytest.approx(1 / SCALES[unit])
    np.testing.assert_allclose(motion.positions, positions, atol=1e-3)


def test_a_left_handed_world_is_mirrored_back(tmp_path):
    world, root = person("sits on a chair")
    positions = points(world, root)
    np.save(tmp_path / "a.npy", positions * [-1, 1, 1])
    motion, reading = read_motion_with(tmp_path / "a.npy")
    assert reading.mirrored
    np.testing.assert_allclose(motion.positions, positions, atol=1e-5)
    kept, reading = read_motion_with(tmp_path / "a.npy", mirror=False)
    assert not reading.mirrored
    np.testing.assert_allclose(kept.positions, positions * [-1, 1, 1], atol=1e-5)


def test_options_stand_in_a_mapping_file_too(tmp_path):
    world, root = person("stands")
    (tmp_path / "a.bvh").write_text(written(world, root, "z", "t"))
    told = {"up": "y", "unit": "in", "mirror": False, "skip_first": True, "head": "neck", "neck": "head"}
    (tmp_path / "map.json").write_text("\ufeff" + json.dumps(told), "utf-8")
    motion, reading = read_motion_with(tmp_path / "a.bvh", tmp_path / "map.json")
    assert (reading.up, reading.unit, reading.mirrored, reading.skipped_first) == ("y", 0.0254, False, True)
    assert {"up", "unit", "mirror", "skip_first", "mapping"} == set(reading.told)
    assert motion.frames == len(root) - 1
    over, reading = read_motion_with(tmp_path / "a.bvh", tmp_path / "map.json", unit="cm", skip_first=False)
    assert reading.unit == 0.01
    assert over.frames == len(root)
    for wrong in ({"up": "w"}, {"unit": 0}, {"mirror": "maybe"}, {"pu": "z"}):
        (tmp_path / "map.json").write_text(json.dumps(wrong))
        with pytest.raises(InputError, match=r"map\.json"):
            read_motion(tmp_path / "a.bvh", tmp_path / "map.json")


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_rest_pose_before_a_quick_motion_is_left_out(tmp_path, up):
    """At ten frames a second a swing goes as far in a frame as the jump out of the rest pose; no other start goes."""
    world, root = person("stands")
    swing = quat_product(np.tile([0.3, 0, 0, 0.9539392], (40, 22, 1)), world)
    world[::2, 16:] = swing[::2, 16:]  # both arms, to and fro
    rest = np.tile([0.0, 0, 0, 1], (1, 22, 1))
    for first, left_out in ((rest, True), (world[:1], False)):
        text = written(np.concatenate([first, world]), np.concatenate([root[:1], root]), up, "t")
        (tmp_path / "a.bvh").write_text(text.replace("Frame Time: 0.05", "Frame Time: 0.1"))
        motion, reading = read_motion_with(tmp_path / "a.bvh")
        assert (motion.fps, reading.skipped_first, motion.frames) == (10, left_out, 41 - left_out)
    kept, _ = read_motion_with(tmp_path / "a.bvh", skip_first=False)
    assert kept.frames == 41


@pytest.mark.parametrize("rest", ["a", "x"])
def test_a_t_pose_before_a_walk_of_a_rig_that_rests_otherwise_is_left_out(tmp_path, rest):
    """Its joints are turned, so that only the pose tells: nobody stands so evenly. One that is less even is doubted."""
    world, root = person("stands")
    swing = quat_product(np.tile([0.3, 0, 0, 0.9539392], (40, 22, 1)), world)
    world[::2, 16:] = swing[::2, 16:]
    even = np.tile([0.0, 0, 0, 1], (1, 22, 1))
    uneven = even.copy()
    uneven[:, 16::2] = quat_product(turn(2, np.full((1, 3), 8.0)), uneven[:, 16::2])
    for first, left_out in ((even, True), (uneven, False)):
        text = written(np.concatenate([first, world]), np.concatenate([root[:1], root]), "y", rest)
        (tmp_path / "a.bvh").write_text(text.replace("Frame Time: 0.05", "Frame Time: 0.1"))
        motion, reading = read_motion_with(tmp_path / "a.bvh")
        assert (reading.skipped_first, motion.frames) == (left_out, 41 - left_out)
        assert any("may be a calibration pose" in note for note in reading.notes) != left_out
        for skip in (True, False):  # what is said is not doubted
            assert not any("calibration" in n for n in read_motion_with(tmp_path / "a.bvh", skip_first=skip)[1].notes)


@pytest.mark.parametrize("rest", ["x", "y"])
def test_a_first_frame_in_the_rigs_own_rest_pose_is_left_out_whatever_that_is(tmp_path, rest):
    """As with bones along one axis (LaFAN1)."""
    world, root = person("stands")
    first = quat_conjugation(rest_frames(SMPL, rest))[None]  # no channel turns
    (tmp_path / "a.bvh").write_text(
        written(np.concatenate([first, world]), np.concatenate([root[:1], root]), "y", rest)
    )
    motion, reading = read_motion_with(tmp_path / "a.bvh")
    assert (reading.skipped_first, motion.frames) == (True, len(root))
    np.testing.assert_allclose(motion.positions, points(world, root), atol=2e-3)


@pytest.mark.parametrize(("held", "back"), [(2, 0), (12, 0), (12, 12)])
def test_a_t_pose_that_is_held_before_the_motion_is_kept_and_told(tmp_path, held, back):
    """Times beside a file count its frames, so none is left out; a body that leaves the pose slowly holds it itself."""
    world, root = person("stands")
    rest = np.tile([0.0, 0, 0, 1], (1, 22, 1))
    share = np.linspace(0, 1, back + 2)[1:-1, None, None]
    way = rest * (1 - share) + world[:1] * np.where((world[:1] * rest).sum(-1, keepdims=True) < 0, -1, 1) * share
    frames = np.concatenate([np.repeat(rest, held, 0), way / np.linalg.norm(way, axis=-1, keepdims=True), world])
    places = np.concatenate([np.repeat(root[:1], held + back, 0), root])
    (tmp_path / "a.bvh").write_text(written(frames, places, "y", "t"))
    motion, reading = read_motion_with(tmp_path / "a.bvh")
    assert (motion.frames, reading.skipped_first) == (len(frames), False)
    told = [note for note in reading.notes if f"the first {held} frames hold a calibration pose" in note]
    assert len(told) == (back == 0)
    assert all(f"{held / motion.fps:.2f} s" in note for note in told)


def test_a_unit_that_was_given_and_fits_nobody_is_said(tmp_path):
    (tmp_path / "a.bvh").write_text(written(*person("stands"), "y", "t"))
    motion, reading = read_motion_with(tmp_path / "a.bvh", unit="m")
    assert np.ptp(motion.positions[0, :, 1]) > 100
    assert any("with the unit that was given" in note for note in reading.notes)
    assert not read_motion_with(tmp_path / "a.bvh", unit="cm")[1].notes
    with pytest.raises(InputError, match="unit: True"):
        read_motion(tmp_path / "a.bvh", unit=True)


def test_a_mapping_against_the_tree_is_said(tmp_path):
    world, root = person("stands")
    (tmp_path / "a.bvh").write_text(written(world, root, "y", "t"))
    with pytest.warns(InputWarning, match=r"right_ankle \(left_ankle\) is not below"):
        read_motion(tmp_path / "a.bvh", {"left_ankle": "right_ankle", "right_ankle": "left_ankle"})


def test_a_mapping_whose_sides_are_swapped_is_said(tmp_path):
    """Else the world would be reflected in silence to make it fit."""
    world, root = person("stands")
    names = [f"j{i}" for i in range(22)]
    text = written(world, root, "y", "t")
    for name, other in sorted(zip(SMPL.joints, names, strict=True), reverse=True):
        text = text.replace(f" {name}\n", f" {other}\n")
    (tmp_path / "a.bvh").write_text(text)
    fits = {role: names[joint] for role, joint in SMPL.roles.items()}
    swap = {"left": "right", "right": "left"}
    swapped = {"_".join(swap.get(word, word) for word in role.split("_")): name for role, name in fits.items()}
    assert not read_motion_with(tmp_path / "a.bvh", fits)[1].notes
    assert any("left and right" in note for note in read_motion_with(tmp_path / "a.bvh", swapped)[1].notes)


@pytest.mark.parametrize("rest", RESTS)
@pytest.mark.parametrize("posture", POSTURES)
def test_people_moved_to_the_origin_are_upright_or_doubted(tmp_path, posture, rest):
    """The pelvis at zero is as near to the ground as the head: heights over the origin tell nothing."""
    world, root = person(posture)
    root = root - root[0]
    for up in ("y",) if rest in ("t", "a") else ("y", "z"):  # who lies along a standing rest pose looks as if standing
        (tmp_path / "a.bvh").write_text(written(world, root, up, rest))
        motion, reading = read_motion_with(tmp_path / "a.bvh")
        assert reading.up == up or any(note.startswith("up is uncertain") for note in reading.notes), reading
        if posture == "stands":
            np.testing.assert_allclose(motion.positions, points(world, root), atol=2e-3)


def doubted(reading) -> bool:
    return any(note.startswith("up is uncertain") for note in reading.notes)


def test_limbs_through_the_floor_and_an_origin_off_the_ground_are_read_right_or_doubted(tmp_path):
    """Made motion has both: heights over the origin then contradict the posture, or both say the same wrong thing."""
    rng = np.random.default_rng(1)
    silent = 0
    for posture in POSTURES:
        for _ in range(20):
            body = points(*restless(posture, rng, int(rng.choice([10, 40]))))
            body[..., 1] += 0.25 * rng.normal()
            up = str(rng.choice(list(ONTO)))
            np.save(tmp_path / "a.npy", quat_action(np.array(ONTO[up]), body))
            _, reading = read_motion_with(tmp_path / "a.npy")
            silent += reading.up != up and not doubted(reading)
    assert silent <= 1


@pytest.mark.parametrize("frames", [1, 20])
def test_one_still_pose_is_doubted(tmp_path, frames):
    """Who stands over the origin with y up may lie there with z up: nothing moves that would tell."""
    body = np.repeat(points(*person("stands"))[:1], frames, axis=0)
    body -= [body[..., 0].mean(), body[..., 1].min(), body[..., 2].mean()]
    np.save(tmp_path / "a.npy", body)
    with pytest.warns(InputWarning, match="up is uncertain: took y as up.*--up"):
        motion = read_motion(tmp_path / "a.npy")
    np.testing.assert_allclose(motion.positions, body, atol=1e-5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_motion(tmp_path / "a.npy", up="y")


def test_points_that_are_no_body_are_left_and_said(tmp_path):
    noise = np.random.default_rng(0).normal(size=(9, 22, 3)).astype(np.float32)
    np.save(tmp_path / "a.npy", noise)
    with pytest.warns(InputWarning, match="keep no bone lengths.*--up"):
        motion = read_motion(tmp_path / "a.npy")
    np.testing.assert_array_equal(motion.positions, noise)


def test_what_was_written_here_is_read_as_it_was(tmp_path):
    """A file with a skeleton of ours is metres, y up, however the person lies in it."""
    world, root = person("lies on the back")
    motion = Motion(quat_action(np.array(ONTO["x"]), points(world, root)) * 3, 20, SMPL)
    motion.save(tmp_path / "a.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(read_motion(tmp_path / "a.npz").positions, motion.positions)


@pytest.mark.real
@pytest.mark.parametrize("kind", ["array", "bvh"])
def test_real_clips_turned_scaled_and_mirrored(shared_data, tmp_path, kind):
    """Clips of all postures, a quarter of them on the floor: every miss is warned of, and there are few."""
    wrong: dict[str, list[Case]] = {"up": [], "unit": [], "mirror": []}
    for case in cases(shared_data, CLIPS):
        path = tmp_path / ("a.npy" if kind == "array" else "a.bvh")
        if kind == "array":
            np.save(path, case.array().astype(np.float32))
        else:
            path.write_text(case.bvh())
        _, reading = read_motion_with(path)
        right = {
            "up": reading.up == case.up,
            "unit": abs(reading.unit * SCALES[case.unit] - 1) < 1e-6,
            "mirror": reading.mirrored == case.mirrored,
        }
        for name in (name for name, good in right.items() if not good):
            wrong[name].append(case)
            assert any(note.startswith(name) for note in reading.notes), (name, case)
    least = {"up": 1.0 if kind == "bvh" else 0.98, "unit": 0.99, "mirror": 0.95}
    for name, share in least.items():
        assert len(wrong[name]) <= (1 - share) * CLIPS, (name, wrong[name])


@pytest.mark.parametrize("up", ["z", "-y", "x"])
def test_a_fall_tells_which_way_is_up(up):
    """A body stiff as a board that flies: no ground, no posture, only gravity, at any rate; upside down as well."""
    body = np.repeat(points(*person("lies on the back"))[:1], 60, axis=0)
    for fps in (20, 30, 120):
        time = np.arange(60) / fps
        height = np.maximum(2 + 3 * time - 9.81 / 2 * time**2, -3)
        thrown = body + np.stack([2 * time, height, 0 * time], -1)[:, None]
        turned = quat_action(np.array(ONTO[up]), thrown)
        found = body_of(turned, dict(SMPL.roles), fps)
        assert found is not None
        falls = _falls(found.pull)
        assert falls[list(AXES).index(up)] == 1
        assert falls.sum() == 1
    still = body_of(body, dict(SMPL.roles), 20)
    assert still is not None
    assert not _falls(still.pull).any()
