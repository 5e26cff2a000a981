"""Pictures show what is there: limbs where they project, colours by side, captions, panels; files that decode."""

from __future__ import annotations

import errno
import os
import resource
import subprocess
import tempfile

import numpy as np
import psutil
import pytest
from imageio_ffmpeg import get_ffmpeg_exe, read_frames

from motionary.errors import InputError
from motionary.formats.render.figure import COLORS, limbs, segments
from motionary.formats.render.overhead import draw_overhead
from motionary.formats.render.scene import Scene
from motionary.formats.render.video import Board, _encode, render_frame, render_strip, write_video
from motionary.motion import Motion, Skeleton
from motionary.motion.facing import rotate_y


def decode(path) -> tuple[dict, np.ndarray]:
    reader = read_frames(str(path))
    meta = next(reader)
    width, height = meta["size"]
    return meta, np.stack([np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in reader])


def hues(picture: np.ndarray) -> np.ndarray:
    """For each pixel the side whose colour it has (0, 1, 2), or -1."""
    color = picture.astype(float)
    strong = np.ptp(color, axis=-1) > 70
    return np.where(
        strong & (color[..., 0] > color[..., 2]), 0, np.where(strong & (color[..., 2] > color[..., 0]), 2, -1)
    )


def test_limbs_stand_where_they_project(person):
    scene = Scene(person, 320, 320, azimuth=0.0)
    picture = scene.draw(0.0)
    begins, ends, _, sides = segments(person.skeleton, person.positions[0].astype(float) - scene.down)
    middle, _ = scene.camera.project((begins + ends) / 2, scene.target[0])
    empty = scene.ground
    changed = np.abs(picture - empty.draw(scene.target[0])).max(-1) > 12
    x, y = np.floor(middle).astype(int).T
    assert changed[y, x].all()
    found = hues(picture)
    for limb, side in enumerate(sides):
        if side != 1 and limbs(person.skeleton)[limb].reach == 0:
            assert found[y[limb], x[limb]] in (side, -1)
    # Seen from the front, the figure's left side is at the right of the picture.
    assert np.nonzero(found == 0)[1].mean() > np.nonzero(found == 2)[1].mean() + 10


def test_camera_follows_and_keeps_the_figure_in_the_picture(make_walker):
    motion = make_walker(frames=60)
    far = Motion(motion.positions + np.linspace(0, 30, 60)[:, None, None] * np.array([1, 0, 0]), 20, motion.skeleton)
    scene = Scene(far, 200, 200)
    for frame in range(0, 60, 10):
        points, scale = scene.camera.project(
            np.concatenate([scene.begins[frame], scene.ends[frame]]), scene.target[frame]
        )
        assert (scale > 0).all()
        assert points.min() > 0
        assert points.max() < 200


def test_between_frames_is_interpolated(person):
    scene = Scene(person, 96, 96)
    a, between, b = (scene.draw(t) for t in (0.1, 0.125, 0.15))
    assert np.abs(a - b).max() > 5
    assert np.abs(a - between).max() > 1
    np.testing.assert_array_equal(scene.draw(99.0), scene.draw((person.frames - 1) / 20))
    np.testing.assert_array_equal(scene.draw(-1.0), scene.draw(0.0))


def test_picture_values_stay_in_range(person):
    picture = Scene(person, 128, 128).draw(0.4)
    assert picture.min() >= 0
    assert picture.max() <= 255


def test_mp4_decodes_with_the_right_size_and_time(person, tmp_path):
    write_video([person, person], tmp_path / "a.mp4", ["walks", "a person walks"], width=101, height=100, fps=24)
    meta, frames = decode(tmp_path / "a.mp4")
    assert meta["codec"] == "h264"
    assert meta["fps"] == 24
    assert len(frames) == 24
    assert frames.shape[2] == 202
    assert frames.shape[1] % 2 == 0
    expected = render_frame([person, person], 0.5, ["walks", "a person walks"], width=101, height=100)
    assert np.abs(frames[12].astype(float) - expected[: frames.shape[1]]).mean() < 6


def test_gif_decodes(person, tmp_path):
    person.save(tmp_path / "a.gif", width=96, height=96)
    head = (tmp_path / "a.gif").read_bytes()[:6]
    assert head == b"GIF89a"
    command = [
        get_ffmpeg_exe(),
        "-v",
        "error",
        "-i",
        str(tmp_path / "a.gif"),
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-",
    ]
    data = subprocess.run(command, check=True, capture_output=True).stdout
    frames = np.frombuffer(data, np.uint8).reshape(-1, 96, 96, 3)
    assert len(frames) >= person.frames - 1
    assert (hues(frames[5]) == 0).sum() > 20


@pytest.mark.parametrize("kind", ["mp4", "gif"])
def test_a_full_disk_is_told_as_the_system_does(person, tmp_path, monkeypatch, kind):
    """ffmpeg, which writes the file, says it in words; not even its words need a disk."""
    (tmp_path / f"full.{kind}").symlink_to("/dev/full")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    frames = [render_frame(person, 0.0, width=64, height=64)] * 400
    with pytest.raises(OSError, match="No space left") as caught:
        _encode(frames, (64, 64), 20.0, tmp_path / f"full.{kind}", kind == "gif")
    assert caught.value.errno == errno.ENOSPC


@pytest.mark.parametrize("kind", ["mp4", "gif"])
def test_a_video_of_which_the_last_byte_has_no_room_is_not_there(person, tmp_path, kind):
    """The kernel's limit on a file's size stands for a full disk."""
    path = write_video(person, tmp_path / f"a.{kind}", width=96, height=96)
    limit = path.stat().st_size - 1
    path.write_text("precious")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        with pytest.raises(InputError, match="cannot be written") as told:
            write_video(person, path, width=96, height=96)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert str(told.value).startswith(str(path))
    assert path.read_text() == "precious"
    assert os.listdir(tmp_path) == [path.name]


def test_a_video_whose_encoder_is_killed_is_not_there(person, tmp_path, monkeypatch):
    def killed(self, seconds):
        for child in psutil.Process().children():
            if "ffmpeg" in child.name():
                child.kill()
        return self.base.copy()

    monkeypatch.setattr(Board, "draw", killed)
    with pytest.raises(InputError, match=r"a\.mp4: ffmpeg ended with -9: cannot be written"):
        write_video(person, tmp_path / "a.mp4")
    assert os.listdir(tmp_path) == []


def test_strip_has_a_cell_per_pose_and_one_for_the_way(person, tmp_path):
    picture = render_strip([person, person], tmp_path / "a.png", poses=5, width=60, height=100)
    assert picture.shape == (200, 360, 3)
    for column in range(5):
        assert (hues(picture[:100, column * 60 : column * 60 + 60]) >= 0).sum() > 30
    from PIL import Image

    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), picture)


def circling(person: Motion, turns: float, radius: float) -> Motion:
    """The first pose led along a part of a circle to its left, facing ahead."""
    angles = np.linspace(0, 2 * np.pi * turns, 81)
    pose = np.broadcast_to(person.positions[0] - person.positions[0, 0] * [1, 0, 1], (81, *person.positions.shape[1:]))
    moved = rotate_y(pose, angles[:, None])
    centre = np.array([radius, 0, 0])  # x is to the left of who faces +z
    return Motion(moved + centre + rotate_y(np.broadcast_to(-centre, (81, 3)), angles)[:, None], 20, person.skeleton)


def test_the_way_shows_circles_and_turns(person):
    """Seen as the stills are, from half the front: who goes ahead comes nearer, which is down."""
    background = draw_overhead(circling(person, 0, 0), np.zeros(0), 90, 120)[2, 2]

    def inked(motion: Motion, moments: np.ndarray) -> np.ndarray:
        """Pixels of path, dots and headings, (N, 2): from the left, from the top."""
        picture = draw_overhead(motion, moments, 90, 120).astype(int)
        return np.argwhere(np.ptp(picture, axis=-1) > 40)[:, ::-1]

    whole, moments = circling(person, 1, 1.0), np.linspace(0, 80, 8)
    spread = np.ptp(inked(whole, moments[:0]), axis=0)
    assert abs(spread[0] - spread[1]) <= 3  # round
    assert spread[0] > 50
    turning = inked(circling(person, 1, 0.0), moments)  # on the spot: lines all around
    standing = inked(circling(person, 0, 0.0), moments)
    assert np.ptp(turning, axis=0).min() > 18
    assert np.ptp(standing, axis=0).min() < 14
    ahead = Motion(
        person.positions[:1].repeat(41, 0) + np.linspace(0, 2, 41)[:, None, None] * [0, 0, 1], 20, person.skeleton
    )
    picture = draw_overhead(ahead, np.zeros(0), 90, 120).astype(int)
    way = np.argwhere(np.ptp(picture, axis=-1) > 40)
    first, last = way[way[:, 0] == way[:, 0].min()], way[way[:, 0] == way[:, 0].max()]
    assert picture[tuple(first[0])].sum() > picture[tuple(last[0])].sum()  # darker where it ends, nearer to the viewer
    assert background.tolist() == [238, 239, 243]


def test_caption_is_written_below(person):
    plain, labelled = render_frame(person, width=200, height=200), render_frame(person, 0, "waves", 200, 200)
    assert labelled.shape[0] > 200
    np.testing.assert_array_equal(labelled[:200], plain)
    assert labelled[200:].min() < 120
    long = render_frame(person, 0, "word " * 2000, 200, 200)
    assert long.shape[0] < 320


@pytest.mark.real
@pytest.mark.parametrize("name", ["cc_02_01", "daz_train_data_bvh_standard", "bandai_dataset-2_walk_active_003"])
def test_helpers_and_fingers_are_left_out(shared_data, name):
    from motionary.formats import read_motion

    motion = read_motion(shared_data / "bvh" / "motions" / f"{name}.bvh")
    assert 20 <= len(limbs(motion.skeleton)) <= 28
    assert (hues(render_frame(motion, width=160, height=160)) >= 0).sum() > 200


def test_unknown_rigs_and_lone_frames_are_drawn():
    skeleton = Skeleton.from_rig("snake", ["a", "b", "c"], [-1, 0, 1], np.array([[0, 0, 0], [0, 0.5, 0], [0, 0.5, 0]]))
    motion = Motion(np.array([[[0, 0, 0], [0, 0.5, 0], [0.2, 0.9, 0]]]), 20, skeleton)
    assert np.ptp(render_frame(motion, width=64, height=64)[..., 0]) > 60
    assert len(COLORS) == 3


def test_bad_input(person, tmp_path):
    for options in ({"captions": ["a", "b"]}, {"fps": 0}, {"width": 3}, {"height": 10**6}):
        with pytest.raises(InputError):
            write_video(person, tmp_path / "a.mp4", **options)
    with pytest.raises(InputError, match="at least one"):
        write_video([], tmp_path / "a.mp4")
    with pytest.raises(InputError, match="png"):
        render_strip(person, tmp_path / "a.jpg")
    (tmp_path / "b.mp4").write_text("precious")
    with pytest.raises(InputError, match="force"):
        person.save(tmp_path / "b.mp4", force=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["b.mp4"]
