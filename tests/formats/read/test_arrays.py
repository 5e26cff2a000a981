"""npy and npz: exact round trips, what is refused, and that nothing is ever unpickled."""

from __future__ import annotations

import io
import os

import numpy as np
import pytest

from motionary.corpus.demo import demo_clip
from motionary.errors import InputError
from motionary.formats import read_motion, write_motion
from motionary.formats.read import read_motion_with
from motionary.motion import Motion, Skeleton, fit_rotations, foot_contacts


@pytest.fixture
def motion() -> Motion:
    skeleton = Skeleton.named("smpl22")
    rest = np.zeros((22, 3), np.float32)
    for j, p in enumerate(skeleton.parents[1:], 1):
        rest[j] = rest[p] + skeleton.offsets[j]
    drift = np.random.default_rng(0).normal(0, 0.01, (30, 1, 3)).cumsum(0)
    return Motion(rest + drift + [0, 0.9, 0], 25.0, skeleton)


def test_npz_keeps_everything(tmp_path, motion):
    motion = fit_rotations(motion)
    motion.save(tmp_path / "a.npz")
    again = read_motion(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.positions, motion.positions)
    np.testing.assert_array_equal(again.rotations, motion.rotations)
    assert again.fps == 25
    assert again.skeleton == motion.skeleton
    with np.load(tmp_path / "a.npz", allow_pickle=False) as data:
        np.testing.assert_array_equal(data["contacts"], foot_contacts(motion))


@pytest.mark.real
def test_npz_keeps_the_skeleton_of_a_bvh(shared_data, tmp_path):
    motion = read_motion(shared_data / "bvh" / "motions" / "cc_02_01.bvh")
    motion.save(tmp_path / "a.npz")
    again = read_motion(tmp_path / "a.npz")
    assert again.skeleton == motion.skeleton
    np.testing.assert_array_equal(again.rotations, motion.rotations)


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize(("joints", "name"), [(22, "smpl22"), (21, "kit21")])
def test_npy_of_known_layouts(tmp_path, kind, joints, name):
    positions = np.random.default_rng(0).normal(size=(7, joints, 3)).astype(kind)
    np.save(tmp_path / "a.npy", positions)
    motion = read_motion(tmp_path / "a.npy")
    known = Skeleton.named(name)
    assert (motion.skeleton.name, motion.skeleton.joints, motion.skeleton.parents) == (
        name,
        known.joints,
        known.parents,
    )
    # The layout says how joints hang together; whose they are, the bones' own lengths do.
    bones = np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, list(known.parents[1:])], axis=-1)
    np.testing.assert_allclose(motion.skeleton.bone_lengths[1:], np.median(bones, axis=0), rtol=1e-4)
    assert motion.fps == 20
    assert motion.positions.dtype == np.float32
    np.testing.assert_array_equal(motion.positions, positions.astype(np.float32))
    motion.save(tmp_path / "b.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "b.npy"), motion.positions)
    assert read_motion(tmp_path / "b.npy", fps=30).fps == 30


@pytest.mark.real
def test_released_sample(shared_data):
    """The features are those of the joints: the same poses, from the origin on and one frame shorter."""
    folder = shared_data / "humanml3d_sample"
    joints = read_motion(folder / "new_joints" / "012314.npy")
    decoded = read_motion(folder / "new_joint_vecs" / "012314.npy")
    assert joints.skeleton.name == decoded.skeleton.name == "smpl22"
    frames = min(joints.frames, decoded.frames)
    np.testing.assert_allclose(decoded.positions[:frames], joints.positions[:frames], atol=5e-3)


def test_another_skeleton_must_be_given(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((4, 3, 3)))
    with pytest.raises(InputError, match="3 joints"):
        read_motion(tmp_path / "a.npy")
    skeleton = Skeleton.from_rig("three", ["a", "b", "c"], [-1, 0, 1], np.zeros((3, 3)))
    assert read_motion(tmp_path / "a.npy", skeleton=skeleton).skeleton == skeleton
    with pytest.raises(InputError, match=r"a\.npy, positions"):
        read_motion(tmp_path / "a.npy", skeleton=Skeleton.named("smpl22"))


@pytest.mark.parametrize("shape", ["batch", "joints first", "joints first in a batch", "smpl24", "smplh", "smplx"])
def test_shapes_that_programs_write(tmp_path, motion, shape):
    """(1, T, 22, 3), (22, 3, T), (1, 22, 3, T), and SMPL's 24 or SMPL-H's 52 joints, of which the body is kept."""
    body = motion.positions
    hands = body[:, [20] * 15 + [21] * 15] + 0.01
    array = {
        "batch": body[None],
        "joints first": body.transpose(1, 2, 0),
        "joints first in a batch": body.transpose(1, 2, 0)[None],
        "smpl24": np.concatenate([body, hands[:, [0, 15]]], axis=1),
        "smplh": np.concatenate([body, hands], axis=1),
        "smplx": np.concatenate([body, hands, hands[:, :3]], axis=1),
    }[shape]
    np.save(tmp_path / "a.npy", array)
    again = read_motion(tmp_path / "a.npy")
    assert again.skeleton == Skeleton.named("smpl22")
    np.testing.assert_array_equal(again.positions, body)


@pytest.mark.parametrize(("width", "rate"), [(72, "mocap_framerate"), (156, "mocap_frame_rate"), (165, "fps")])
@pytest.mark.parametrize("up", ["z", "y"])
def test_smpl_poses(tmp_path, width, rate, up):
    """A person with a bent left knee walks ahead at 1 m/s: joints in closed form, and rotations that place them."""
    from motionary.motion import forward_kinematics

    frames, ahead = 30, np.arange(30) / 60
    poses = np.zeros((frames, width))
    poses[:, 3 * 4] = np.pi / 2  # the left knee about x: the shin points back
    poses[:, -3:] = 1.0  # a hand or a face, which is left aside
    trans = np.stack([0 * ahead, 0.2233 + 0.87 + 0 * ahead, ahead], -1)
    if up == "z":
        poses[:, 0] = np.pi / 2
        trans = np.stack([0 * ahead, -ahead, 0.2233 + 0.87 + 0 * ahead], -1)
    poses[:, -3:] *= width > 72
    np.savez(tmp_path / "a.npz", poses=poses, trans=trans, betas=np.zeros(16), **{rate: 60.0})
    motion, reading = read_motion_with(tmp_path / "a.npz")
    assert (motion.fps, reading.up) == (60, up)
    at = {name: motion.positions[:, i] for i, name in enumerate(motion.skeleton.joints)}
    np.testing.assert_allclose(at["pelvis"][-1] - at["pelvis"][0], [0, 0, 29 / 60], atol=1e-5)
    shin = at["left_ankle"] - at["left_knee"]
    np.testing.assert_allclose(shin[0], [-0.0148, 0.0374, -0.4269], atol=1e-3)
    np.testing.assert_allclose((at["right_ankle"] - at["right_knee"])[0], [0.0191, -0.42, -0.0346], atol=1e-3)
    placed = forward_kinematics(motion.skeleton, motion.rotations, motion.positions[:, 0])
    np.testing.assert_allclose(placed, motion.positions, atol=1e-5)


NAMES = {
    "amass": ("poses", "trans"),
    "aist": ("smpl_poses", "smpl_trans"),
    "moshpp": ("root_orient", "pose_body", "trans"),
    "smplx": ("global_orient", "body_pose", "transl"),
}


@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("batch", [False, True])
def test_smpl_poses_by_the_names_of_other_programs(tmp_path, names, batch):
    rng = np.random.default_rng(0)
    poses, trans = rng.normal(0, 0.2, (20, 66)), np.full((20, 3), 1.0)
    *parts, place = NAMES[names]
    arrays = dict(zip(parts, [poses] if len(parts) == 1 else [poses[:, :3], poses[:, 3:]], strict=True)) | {
        place: trans
    }
    np.savez(tmp_path / "a.npz", poses=poses, trans=trans, fps=30.0)
    np.savez(tmp_path / "b.npz", **{name: array[None] if batch else array for name, array in arrays.items()})
    one = read_motion(tmp_path / "a.npz", up="y")
    np.testing.assert_array_equal(read_motion(tmp_path / "b.npz", up="y", fps=30).positions, one.positions)
    with pytest.raises(InputError, match="need a rate"):
        read_motion(tmp_path / "b.npz")


@pytest.mark.parametrize("added", [0, 1, 25])
def test_zeros_behind_smpl_poses_are_padding(tmp_path, added):
    poses, trans = np.full((30, 72), 0.3), np.tile([0.3, 0.4, 0.95], (30, 1))
    poses[:, 0] = np.pi / 2
    np.savez(tmp_path / "short.npz", poses=poses, trans=trans, framerate=30.0)
    padded = [np.concatenate([array, np.zeros((added, array.shape[1]))]) for array in (poses, trans)]
    np.savez(tmp_path / "a.npz", poses=padded[0], trans=padded[1], frame_rate=30.0)
    motion, reading = read_motion_with(tmp_path / "a.npz")
    np.testing.assert_array_equal(motion.positions, read_motion(tmp_path / "short.npz").positions)
    assert any(f"the last {added} frames are all zero" in note for note in reading.notes) == (added > 0)


@pytest.mark.parametrize("wrong", ["degrees", "millimetres", "centimetres"])
def test_smpl_poses_in_other_units_are_refused(tmp_path, wrong):
    """Standing still too: a pelvis at 90 m is no pelvis."""
    poses, trans = np.full((30, 72), 0.3), np.tile([0.3, 0.4, 0.95], (30, 1))
    poses[:, 0] = np.pi / 2
    if wrong == "degrees":
        poses = np.degrees(poses)
    else:
        trans *= {"millimetres": 1000, "centimetres": 100}[wrong]
    np.savez(tmp_path / "a.npz", poses=poses, trans=trans, mocap_framerate=30.0)
    with pytest.raises(InputError, match="radians" if wrong == "degrees" else "metres"):
        read_motion(tmp_path / "a.npz")


@pytest.mark.parametrize(
    "change",
    [
        {"poses": np.zeros((5, 70))},
        {"trans": np.zeros((4, 3))},
        {"trans": np.full((5, 3), np.nan)},
        {"fps": "x"},
        {"fps": np.inf},
    ],
)
def test_wrong_smpl_poses_are_named(tmp_path, change):
    np.savez(tmp_path / "a.npz", **{"poses": np.zeros((5, 72)), "trans": np.zeros((5, 3)), "fps": 30.0} | change)
    with pytest.raises(InputError, match=r"a\.npz"):
        read_motion(tmp_path / "a.npz")


class Evil:
    """Unpickling this would make a folder."""

    def __reduce__(self):
        return os.mkdir, ("unpickled",)


def test_nothing_is_unpickled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("a.npy", np.array([Evil()], object), allow_pickle=True)
    np.savez("a.npz", positions=np.array([Evil()], object))
    for name in ("a.npy", "a.npz"):
        with pytest.raises(InputError, match="pickled objects"):
            read_motion(name)
    assert not os.path.exists("unpickled")


def broken(tmp_path, kind):
    good = np.zeros((5, 22, 3), np.float32)
    path = tmp_path / ("a.npz" if kind.startswith("npz") else "a.npy")
    buffer = io.BytesIO()
    np.savez(buffer, positions=good, fps=20.0)
    whole = buffer.getvalue()
    arrays = {
        "npy nan": np.full((5, 22, 3), np.nan),
        "npy inf": np.full((5, 22, 3), np.inf),
        "npy empty": np.zeros((0, 22, 3)),
        "npy normalised": np.random.default_rng(0).normal(size=(9, 263)) - 1,
        "npy batch": np.zeros((3, 5, 22, 3)),
        "npy wide": np.zeros((5, 22, 4)),
        "npy flat": np.zeros(66),
        "npy words": np.full((5, 22, 3), "x"),
    }
    fields = {
        "npz other keys": {"poses": good},
        "npz fps word": {"positions": good, "fps": np.array("fast")},
        "npz fps zero": {"positions": good, "fps": 0.0},
        "npz skeleton text": {"positions": good, "skeleton": np.array("not json")},
        "npz skeleton list": {"positions": good, "skeleton": np.array("[1]")},
        "npz rotations": {"positions": good, "rotations": np.zeros((5, 22, 4))},
    }
    if kind in arrays:
        np.save(path, arrays[kind])
    elif kind in fields:
        np.savez(path, **fields[kind])
    elif kind == "npz truncated":
        path.write_bytes(whole[: len(whole) // 2])
    elif kind == "npz damaged":
        path.write_bytes(whole.replace(b"\0\0\0\0\0\0\0\0", b"\1\0\0\0\0\0\0\0", 300))
    elif kind == "npz text":
        path.write_text("hello")
    elif kind == "npy truncated":
        np.save(path, good)
        path.write_bytes(path.read_bytes()[:-40])
    elif kind == "npy text":
        path.write_text("hello")
    elif kind == "npy nothing":
        path.write_bytes(b"")
    return path


KINDS = [
    "npy normalised",
    "npy batch",
    "npy nan",
    "npy inf",
    "npy empty",
    "npy wide",
    "npy flat",
    "npy words",
    "npy truncated",
    "npy text",
]
KINDS += ["npy nothing", "npz other keys", "npz fps word", "npz fps zero", "npz skeleton text", "npz skeleton list"]
KINDS += ["npz rotations", "npz truncated", "npz damaged", "npz text"]


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_named(tmp_path, kind):
    with pytest.raises(InputError, match=r"a\.np[yz]") as caught:
        read_motion(broken(tmp_path, kind))
    assert "\n" not in str(caught.value)


def test_too_large_when_unpacked(tmp_path):
    """A small file that unpacks to more than a motion of its size can be is refused, whatever its numbers are."""
    for kind in (np.float32, np.int8):
        np.savez_compressed(tmp_path / "a.npz", positions=np.zeros((50_000, 22, 3), kind))
        with pytest.raises(InputError, match=r"a.npz, positions: .*\(50000, 22, 3\): .* may have 1,000,000"):
            read_motion(tmp_path / "a.npz")
    np.savez_compressed(tmp_path / "a.npz", positions=np.zeros((45_000, 22, 3), np.int8))
    assert read_motion(tmp_path / "a.npz").frames == 45_000


def test_paths(tmp_path, motion):
    for path, rule in ((tmp_path / "a.fbx", "fbx"), (tmp_path / "a", "extension"), (tmp_path / "no.bvh", "exist")):
        with pytest.raises(InputError, match=rule):
            read_motion(path)
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(InputError, match="folder"):
        read_motion(tmp_path / "folder.npz")
    for path in (tmp_path / "folder.npz", tmp_path / "a.fbx"):
        with pytest.raises(InputError):
            motion.save(path)
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="folder"):
        motion.save(tmp_path / "file" / "a.npz")


@pytest.mark.parametrize("extension", ["npy", "npz", "bvh"])
def test_an_existing_file_stays_without_force(tmp_path, motion, extension):
    path = tmp_path / f"a.{extension}"
    path.write_text("precious")
    with pytest.raises(InputError, match="force"):
        write_motion(motion, path, force=False)
    assert path.read_text() == "precious"
    write_motion(motion, path)
    assert read_motion(path).frames == motion.frames


def test_a_failed_write_leaves_nothing(tmp_path, motion, monkeypatch):
    from motionary.formats.read import arrays

    path = tmp_path / "a.npz"
    path.write_text("precious")
    monkeypatch.setattr(arrays.np, "savez_compressed", lambda *a, **k: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        motion.save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]
    assert path.read_text() == "precious"


def test_unknown_options_are_named(tmp_path, motion):
    motion.save(tmp_path / "a.npy", fps=None)
    assert read_motion(tmp_path / "a.npy", fps=None, skeleton=None).fps == 20
    with pytest.raises(InputError, match="captions"):
        motion.save(tmp_path / "a.npy", captions="x")
    with pytest.raises(InputError, match="speed"):
        read_motion(tmp_path / "a.npy", speed=2)


def test_an_array_of_the_layouts_own_body_keeps_its_skeleton(tmp_path):
    motion = demo_clip(3)[0]
    motion.save(tmp_path / "a.npy")
    assert read_motion(tmp_path / "a.npy").skeleton == Skeleton.named("smpl22")


@pytest.mark.parametrize("name", ["smpl22", "kit21"])
@pytest.mark.parametrize("batch", [False, True])
def test_released_features_are_read_as_motions(tmp_path, name, batch):
    """(T, 263) on smpl22 at 20 fps, (T, 251) on kit21 at 12.5 fps, each also in a batch of one."""
    from motionary.features import HumanML3D
    from motionary.motion import canonicalize, retarget

    skeleton = Skeleton.named(name)
    rate = {"smpl22": 20.0, "kit21": 12.5}[name]
    motion = canonicalize(retarget(demo_clip(4, fps=rate)[0], skeleton))
    features = HumanML3D(skeleton).encode(motion)
    assert features.shape[1] == {"smpl22": 263, "kit21": 251}[name]
    np.save(tmp_path / "a.npy", features[None] if batch else features)
    again, reading = read_motion_with(tmp_path / "a.npy")
    assert again.skeleton == skeleton
    assert (again.fps, again.frames, reading.up, reading.mirrored) == (rate, len(features), "y", False)
    # The released KIT features begin with the back to +z.
    np.testing.assert_allclose(canonicalize(again).positions, motion.positions[:-1], atol=5e-3)


@pytest.mark.parametrize("name", ["smpl22", "kit21"])
def test_normalised_features_are_refused(tmp_path, name):
    """Their root height may lie where people's does; their rotations' axes have no length of 1."""
    from motionary.features import HumanML3D
    from motionary.motion import retarget

    skeleton = Skeleton.named(name)
    features = HumanML3D(skeleton).encode(retarget(demo_clip(4)[0], skeleton))
    normalised = (features - features.mean(0)) / (features.std(0) + 1e-3)
    normalised[:, 3] += 0.5
    np.save(tmp_path / "a.npy", normalised)
    with pytest.raises(InputError, match=r"raw.*Std \+ Mean"):
        read_motion(tmp_path / "a.npy")
    made = features.copy()  # as a model makes them: rotations that are nearly such
    made[:, 70:190] *= 1.1
    np.save(tmp_path / "a.npy", made)
    assert read_motion(tmp_path / "a.npy").frames == len(made)


@pytest.mark.parametrize("joints", [24, 52])
def test_npz_with_positions_of_smpl_keeps_the_body(tmp_path, motion, joints):
    hands = motion.positions[:, [20, 21] * 15] + 0.01
    array = np.concatenate([motion.positions, hands[:, : joints - 22]], axis=1)
    np.savez(tmp_path / "a.npz", positions=array, fps=25.0)
    again = read_motion(tmp_path / "a.npz")
    assert (again.fps, again.skeleton) == (25.0, Skeleton.named("smpl22"))
    np.testing.assert_array_equal(again.positions, motion.positions)
