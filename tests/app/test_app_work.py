"""What the page does behind the browser: uploads read safely, files written, addresses checked, figures posed."""

from __future__ import annotations

import io
import pickle
import socket
import subprocess
import sys
import tempfile
import zipfile

import numpy as np
import pytest

from motionary import read_motion
from motionary.app import limits, server, work
from motionary.app.figures import Limbs
from motionary.app.mannequins import Mannequins
from motionary.corpus.demo import demo_clip
from motionary.errors import InputError
from motionary.formats.write.array_writer import write_npz
from motionary.motion import Motion


@pytest.fixture(scope="module")
def walk():
    return demo_clip(3)[0]


def saved(motion, path) -> bytes:
    motion.save(path)
    return path.read_bytes()


@pytest.mark.parametrize("extension", [".bvh", ".npz"])
def test_uploads_are_read(walk, tmp_path, extension):
    found = work.read_upload(f"C:\\somewhere\\x{extension.upper()}", saved(walk, tmp_path / f"x{extension}"))
    assert np.abs(found.positions - walk.positions).max() < 0.002


def test_bad_uploads_are_one_line_that_names_them(walk, tmp_path, monkeypatch):
    class Evil:
        def __reduce__(self):
            return (pytest.fail, ("unpickled",))

    pickled = io.BytesIO()
    np.savez(pickled, positions=np.array([Evil()], dtype=object), allow_pickle=True)
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("positions.npy", bytes(limits.MOST_UNPACKED + 1))
    good = saved(walk, tmp_path / "x.bvh")
    cases = {
        "a.exe": (b"MZ", "only .bvh .npz"),
        "noname": (b"x", "only .bvh .npz"),
        "a.pkl": (pickle.dumps(1), "only .bvh .npz"),
        "half.bvh": (good[: len(good) // 2], "half.bvh"),
        "empty.bvh": (b"", "empty"),
        "noise.npz": (bytes(range(256)) * 8, "not a readable"),
        "pickled.npz": (pickled.getvalue(), "never loaded"),
        "bomb.npz": (bomb.getvalue(), "when unpacked"),
        "big.bvh": (bytes(limits.MOST_BYTES + 1), "at most 20 MB"),
        "../../etc/x.bvh": (b"nonsense", "x.bvh"),
    }
    for name, (content, message) in cases.items():
        with pytest.raises(InputError) as caught:
            work.read_upload(name, content)
        line = str(caught.value)
        assert message in line, name
        assert line.startswith(name.rsplit("/")[-1]), line
        assert "/tmp" not in line
        assert "\n" not in line
    monkeypatch.setattr(work, "MOST_SECONDS", 0.5)
    with pytest.raises(InputError, match="at most 0 s"):
        work.read_upload("long.bvh", good)
    monkeypatch.undo()
    monkeypatch.setattr(work, "MOST_PLACES", walk.frames * len(walk.skeleton.joints) - 1)
    with pytest.raises(InputError, match="joints times frames"):
        work.read_upload("wide.bvh", good)


def test_files_are_those_that_save_writes(walk, tmp_path):
    short = walk.crop(0, 6)
    for extension in (".bvh", ".glb", ".npy", ".html"):
        assert work.file_bytes(short, extension, "") == saved(short, tmp_path / f"x{extension}"), extension
    (tmp_path / "y.npz").write_bytes(work.file_bytes(short, ".npz", "a walk"))
    assert (read_motion(tmp_path / "y.npz").positions == short.positions).all()
    assert work.file_bytes(short, ".mp4", "a walk")[4:8] == b"ftyp"
    assert work.file_bytes(short, ".gif", "a walk")[:4] == b"GIF8"
    assert b"a &lt;walk&gt;" in work.file_bytes(short, ".html", "a <walk>")
    for extension in (".exe", "./../x.bvh", ""):
        with pytest.raises(InputError, match=r"must be one of \.bvh, \.glb, \.npz"):
            work.file_bytes(short, extension, "")


def test_every_file_that_motions_are_written_to_is_offered():
    from motionary.formats import WRITERS

    assert set(work.WRITABLE) == set(WRITERS)


def test_a_video_shows_no_more_than_it_may(walk, monkeypatch):
    monkeypatch.setattr(work, "MOST_VIDEO", 0.3)
    assert frames_in(work.file_bytes(walk, ".mp4", "")) == round(0.3 * walk.fps)
    assert frames_in(work.file_bytes(walk.crop(0, 4), ".mp4", "")) == 4


def frames_in(video: bytes) -> int:
    """Frames of an mp4, counted by decoding it."""
    import imageio_ffmpeg

    with tempfile.NamedTemporaryFile(suffix=".mp4") as file:
        file.write(video)
        file.flush()
        return imageio_ffmpeg.count_frames_and_secs(file.name)[0]


def test_a_port_in_use_and_missing_models_are_one_line(pipeline, tmp_path):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = str(other.getsockname()[1])
        command = [sys.executable, "-m", "motionary.cli", "app", "--port", port, "--models", str(pipeline / "models")]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"error: --port: {port}: in use; choose another\n"
    for host, port in (("127.0.0.1", 70_000), ("192.0.2.1", 8080)):
        with pytest.raises(InputError, match=r"--port|--host"):
            server.check_port(host, port)
    with pytest.raises(InputError, match=r"dvc repro"):
        server.App(tmp_path / "nothing", "cpu", "127.0.0.1", 0)


def test_it_listens_here_alone_unless_told_otherwise():
    from motionary.cli.command import build_parser
    from motionary.cli.commands import COMMANDS

    assert build_parser(COMMANDS).parse_args(["app"]).host == "127.0.0.1"


class Scene:
    """Keeps what is added, as viser's scene does."""

    class Node:
        removed = False

        def __init__(self, **given):
            self.__dict__.update(given)
            self.bones = [Scene.Node() for _ in given.get("bone_positions", [])]

        def remove(self):
            self.removed = True

    def add_batched_meshes_simple(self, name, vertices, faces, wxyzs, positions, **given):
        return self.Node(vertices=vertices, faces=faces, batched_wxyzs=wxyzs, batched_positions=positions, **given)

    def add_mesh_skinned(self, name, vertices, faces, **given):
        assert given["skin_weights"].shape == (len(vertices), len(given["bone_positions"]))
        np.testing.assert_allclose(given["skin_weights"].sum(1), 1, atol=1e-4)
        given["skin_indices"] = np.zeros((len(vertices), 4), np.uint16)
        return self.Node(vertices=vertices, faces=faces, **given)


def test_limbs_reach_from_joint_to_joint(walk):
    figure = Limbs(Scene(), "x", walk, np.array([1.0, 0, 0]))
    figure.pose(7)
    wxyz, middles = figure.tubes.batched_wxyzs, figure.tubes.batched_positions
    length = figure.tubes.batched_scales[:, 1]
    w, x, y, z = wxyz.T
    along = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], -1)  # where +y is turned
    half = len(middles)
    tips = middles + along * length[:, None] / 2
    assert np.abs(tips - figure.balls.batched_positions[half:]).max() < 0.03
    joints = walk.positions[7] + [1, 0, 0]
    assert all(np.linalg.norm(figure.balls.batched_positions - j, axis=-1).min() < 0.2 for j in joints)


def test_one_mannequin_serves_all_motions_on_like_rigs_one_after_another(walk):
    scene = Scene()
    mannequins = Mannequins(scene, "x")
    first = mannequins.take(walk, np.zeros(3))
    second = mannequins.take(walk, np.ones(3))
    assert first.mesh is not second.mesh
    first.remove()
    assert not first.mesh.removed  # the page would die
    assert not first.mesh.visible
    again = mannequins.take(walk.crop(3, 9), np.zeros(3))
    assert again.mesh is first.mesh
    assert again.mesh.visible
    again.remove()
    larger = mannequins.take(Motion(walk.positions * 1.3, walk.fps, walk.skeleton), np.zeros(3))
    assert larger.mesh is not first.mesh


def test_hidden_mannequins_of_many_rigs_take_no_room(walk):
    mannequins, made = Mannequins(Scene(), "x"), []
    for size in np.linspace(0.8, 1.25, 12):
        made.append(mannequins.take(Motion(walk.positions * size, walk.fps, walk.skeleton), np.zeros(3)))
        made[-1].remove()
    full = [figure for figure in made if len(figure.mesh.vertices) > 1]
    assert len(full) == 6
    assert all(len(figure.mesh.skin_weights) == len(figure.mesh.vertices) for figure in made)


def test_a_mannequin_s_bones_follow_the_joints(walk):
    figure = Mannequins(Scene(), "x").take(walk, np.zeros(3))
    figure.pose(5)
    bones = np.stack([bone.position for bone in figure.mesh.bones])
    far = [np.linalg.norm(walk.positions[5] - bone, axis=-1).min() for bone in bones]
    assert max(far) < 0.01


def test_what_npz_holds_is_what_comes_back(walk, tmp_path):
    path = write_npz(walk, tmp_path / "a.npz")
    assert work.read_upload("a.npz", path.read_bytes()).fps == walk.fps
