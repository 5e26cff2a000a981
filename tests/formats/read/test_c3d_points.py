"""C3D files: labels that name joints make a motion, markers on the skin do not."""

from __future__ import annotations

import numpy as np
import pytest
from c3d_files import c3d_bytes

from motionary.corpus.demo import demo_clip
from motionary.corpus.sources import FolderSource
from motionary.errors import InputError
from motionary.formats.read import read_motion_with
from motionary.motion import retarget

CLIP = demo_clip(3)[0]
NAMES = CLIP.skeleton.joints
LAB = CLIP.positions[..., [0, 2, 1]] * [1000, -1000, 1000]  # millimetres, z up, as a laboratory has it
# What Plug-in Gait writes of joints beside the markers.
GAIT = {"hip": "FEP", "knee": "FEO", "ankle": "TIO", "foot": "TOE", "shoulder": "CLO", "elbow": "HUO", "wrist": "RAO"}
NEVER_WHOLE = np.arange(len(LAB))[:, None] % 22 == np.arange(22)
MARKERS = ("LASI", "RASI", "LPSI", "RPSI", "LKNE", "RKNE", "LANK", "RANK", "LTOE", "RTOE", "LSHO", "RSHO", "C7")


@pytest.fixture
def read(tmp_path):
    def of(labels, places, rate=CLIP.fps, unit="mm", **options):
        (tmp_path / "take.c3d").write_bytes(c3d_bytes(labels, places, rate, unit))
        return read_motion_with(tmp_path / "take.c3d", **options)

    return of


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1.0), ("cm", 0.1), ("m", 0.001), ("in", 1 / 25.4)])
def test_joints_come_back_where_they_were(read, unit, scale):
    motion, reading = read(NAMES, LAB * scale, unit=unit)
    assert (reading.up, motion.fps, motion.skeleton.joints) == ("z", CLIP.fps, NAMES)
    assert not reading.mirrored
    assert not reading.notes
    np.testing.assert_allclose(motion.positions, CLIP.positions, atol=2e-4)
    lengths = np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, list(motion.skeleton.parents[1:])], axis=-1)
    np.testing.assert_allclose(np.median(lengths, axis=0), motion.skeleton.bone_lengths[1:], atol=1e-4)


def test_a_motion_of_labels_goes_onto_the_corpus_s_skeleton(read):
    motion, _ = read([f"subject:{name}" for name in NAMES], LAB)
    again = retarget(motion, CLIP.skeleton)
    of_root = [m.positions - m.positions[:, :1] for m in (again, CLIP)]
    assert np.linalg.norm(of_root[0] - of_root[1], axis=-1).mean() < 0.01


def test_joint_centres_beside_markers_are_the_joints(read):
    """Plug-in Gait has no pelvis's centre: it lies between the hips."""
    wanted = {f"{side}_{part}": f"{side[0].upper()}{name}" for side in ("left", "right") for part, name in GAIT.items()}
    rng = np.random.default_rng(0)
    markers = LAB[:, rng.integers(0, 22, len(MARKERS))] + rng.normal(size=(len(LAB), len(MARKERS), 3))
    places = np.concatenate([LAB[:, [NAMES.index(role) for role in wanted]], markers], axis=1)
    labels = [*wanted.values(), *(name for name in MARKERS if name not in wanted.values())]
    motion, _ = read(labels, places[:, : len(labels)])
    hips = [NAMES.index("left_hip"), NAMES.index("right_hip")]
    np.testing.assert_allclose(motion.positions[:, 0], CLIP.positions[:, hips].mean(1), atol=2e-4)
    for role in wanted:
        seen = motion.positions[:, motion.skeleton.roles[role]]
        np.testing.assert_allclose(seen, CLIP.positions[:, NAMES.index(role)], atol=2e-4)


def test_ends_without_a_joint_go_and_gaps_are_filled_and_said(read):
    places = LAB.copy()
    knee = NAMES.index("left_knee")
    places[:4, knee] = places[-3:, 0] = places[20:25, knee] = np.nan
    motion, reading = read(NAMES, places)
    assert motion.frames == len(LAB) - 7
    kept = CLIP.positions[4:-3]
    np.testing.assert_allclose(np.delete(motion.positions, knee, 1), np.delete(kept, knee, 1), atol=2e-4)
    line = kept[15, knee] + np.linspace(0, 1, 7)[:, None] * (kept[21, knee] - kept[15, knee])
    np.testing.assert_allclose(motion.positions[15:22, knee], line, atol=2e-4)
    assert reading.notes == (
        "the first 4 and the last 3 frames lack joints and were left out",
        f"without a place, filled on straight lines: left_knee in 5 of {len(LAB) - 7} frames",
    )


def test_zeros_of_residual_0_are_gaps_too(read):
    """Many exporters write a point that was not seen as (0, 0, 0)."""
    wrist, places = NAMES.index("left_wrist"), LAB.copy()
    places[30:40, wrist] = places[50:53] = places[-2:] = 0
    motion, reading = read(NAMES, places)
    expected = CLIP.positions[:-2].copy()
    expected[30:40, wrist] = np.linspace(expected[29, wrist], expected[40, wrist], 12)[1:-1]
    expected[50:53] = np.linspace(expected[49], expected[53], 5)[1:-1]
    np.testing.assert_allclose(motion.positions, expected, atol=3e-4)
    assert reading.notes == (
        "the last 2 frames hold no body and were left out",
        f"without a place, filled on straight lines: left_wrist in 10 of {len(LAB) - 2} frames",
        f"3 of {len(LAB) - 2} frames hold no body, and were filled on straight lines",
    )


@pytest.mark.parametrize("always", [True, False])
def test_a_pelvis_may_be_the_origin(read, always):
    """Of the body in each frame, or of the first one alone."""
    moved = LAB - (LAB[:, :1] if always else LAB[:1, :1])
    motion, reading = read(NAMES, moved, up="z", unit="mm", mirror=False)
    np.testing.assert_allclose(motion.positions, moved[..., [0, 2, 1]] * [0.001, 0.001, -0.001], atol=3e-4)
    assert not [note for note in reading.notes if "frames" in note]


def test_a_pelvis_at_zero_of_a_body_elsewhere_was_never_seen(read):
    with pytest.raises(InputError, match="pelvis: missing in 100%"):
        read(NAMES, np.where(np.arange(22)[:, None] == 0, 0, LAB))


def test_a_mapping_names_labels_that_no_rig_has(read):
    labels = [f"point {i:02d}" for i in range(22)]
    with pytest.raises(InputError, match=r"take\.c3d: 22 points: point 00, .*labels must name joints"):
        read(labels, LAB)
    roles = {name: label for name, label in zip(NAMES, labels, strict=True)}
    motion, reading = read(labels, LAB, mapping=roles)
    assert reading.roles == "mapping"
    np.testing.assert_allclose(motion.positions, CLIP.positions, atol=2e-4)


@pytest.mark.parametrize(
    ("labels", "places", "said"),
    [
        (MARKERS, LAB[:, :13], "13 points: LASI, .*markers on the skin are none.*--mapping"),
        ([f"{who}:{name}" for who in ("Ann", "Bob") for name in NAMES], LAB[:, [*range(22)] * 2], "2 people: Ann, Bob"),
        (NAMES, np.where(np.arange(22)[:, None] == 4, np.nan, LAB), r"left_knee: missing in 100%"),
        (
            NAMES,
            np.where(np.arange(len(LAB))[:, None, None] % 22 == np.arange(22)[:, None], np.nan, LAB),
            "every joint",
        ),
    ],
    ids=["markers", "two people", "no knee", "no whole frame"],
)
def test_what_cannot_be_a_motion_is_one_line(read, labels, places, said):
    with pytest.raises(InputError, match=said) as caught:
        read(labels, places)
    assert "\n" not in str(caught.value)


def test_damaged_files_are_said(tmp_path):
    good, path = c3d_bytes(NAMES, LAB, CLIP.fps), tmp_path / "take.c3d"
    for size in (1, 100, 600, 1500, len(good) // 2):
        path.write_bytes(good[:size])
        with pytest.raises(InputError, match=r"take\.c3d"):
            read_motion_with(path)


def test_a_folder_of_them_is_a_data_root(tmp_path):
    (tmp_path / "walk.c3d").write_bytes(c3d_bytes(NAMES, LAB, CLIP.fps))
    (clip,), problems = FolderSource(tmp_path, "root").clips()
    assert not problems
    assert clip.load(clip)[0].frames == CLIP.frames
