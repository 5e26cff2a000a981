"""Writing under faults: errors, a killed process, a full disk, forbidden folders, links and permissions."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from motionary.errors import InputError
from motionary.files import UNFINISHED, atomic_file, atomic_folder, write_bytes

WRITE_FILE = """
with atomic_file("kept/a.txt") as temporary:
    temporary.write_text("half")
"""
WRITE_FOLDER = """
with atomic_folder("kept") as temporary:
    (temporary / "a.txt").write_text("half")
"""
KILLED = """
import os, signal
from motionary.files import atomic_file, atomic_folder
os.replace = lambda *paths: os.kill(os.getpid(), signal.SIGKILL)
"""
FULL = """
import resource
from pathlib import Path
from motionary.errors import InputError
from motionary.files import atomic_file, atomic_folder
{before}
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
{block}
except InputError as error:
    print(error)
"""


def script(text: str, cwd: Path) -> subprocess.CompletedProcess:
    # -B: what a full disk cuts short may not be the compiled modules of the environment, which others then load.
    return subprocess.run([sys.executable, "-B", "-c", text], cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture
def kept(tmp_path) -> Path:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "a.txt").write_text("precious")
    return tmp_path / "kept"


def half_then_crash(path: Path) -> None:
    path.write_text("half")
    raise RuntimeError("crash")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_what_is_written_takes_the_place_whole(kept):
    write_bytes(kept / "a.txt", "new")
    assert (kept / "a.txt").read_text() == "new"
    assert names(kept) == ["a.txt"]
    with atomic_folder(kept) as folder:
        (folder / "deep").mkdir()
        (folder / "deep" / "b.txt").write_text("b")
        assert (kept / "a.txt").exists()
    assert names(kept) == ["deep"]
    assert names(kept.parent) == ["kept"]
    with atomic_folder(kept.parent / "x" / "new") as folder:
        (folder / "c").write_text("c")
    assert names(kept.parent / "x") == ["new"]


def test_an_error_leaves_everything_as_it_was(kept):
    with pytest.raises(RuntimeError, match="crash"), atomic_file(kept / "a.txt") as temporary:
        half_then_crash(temporary)
    with pytest.raises(RuntimeError, match="crash"), atomic_folder(kept) as temporary:
        half_then_crash(temporary / "a.txt")
    assert (kept / "a.txt").read_text() == "precious"
    assert names(kept) == ["a.txt"]
    assert names(kept.parent) == ["kept"]


@pytest.mark.parametrize("write", [WRITE_FILE, WRITE_FOLDER])
def test_a_process_killed_before_the_replacement_leaves_the_old_one(kept, write):
    assert script(KILLED + write, kept.parent).returncode == -signal.SIGKILL
    assert (kept / "a.txt").read_text() == "precious"
    left = [path for path in kept.parent.rglob("*") if path.name not in ("kept", "a.txt")]
    assert len(left) == 1
    assert left[0].name.startswith(UNFINISHED)


def test_a_folder_that_cannot_take_the_place_gives_it_back(kept, monkeypatch):
    true, calls = os.replace, []

    def fail_once(source, target):
        calls.append(target)
        if len(calls) == 2:
            raise OSError("no")
        true(source, target)

    monkeypatch.setattr(os, "replace", fail_once)
    with pytest.raises(OSError, match="no"), atomic_folder(kept) as temporary:
        (temporary / "b.txt").write_text("b")
    assert names(kept) == ["a.txt"]
    assert names(kept.parent) == ["kept"]


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o007])
def test_permissions_are_those_of_a_plain_open(kept, mask):
    before = os.umask(mask)
    try:
        write_bytes(kept / "new.txt", b"x")
        with atomic_folder(kept.parent / "new") as folder:
            (folder / "a").write_text("a")
    finally:
        os.umask(before)
    assert (kept / "new.txt").stat().st_mode & 0o777 == 0o666 & ~mask
    assert (kept.parent / "new").stat().st_mode & 0o777 == 0o777 & ~mask


MODEL = """
import torch
from motionary.training.checkpoint import save_checkpoint
model = torch.nn.Linear(100, 100)
optimizer = torch.optim.SGD(model.parameters())
"""
CLIP = """
from motionary.corpus.demo import demo_clip
from motionary.formats.render.video import write_video
clip = demo_clip(3)[0]
"""


ARRAY = "import numpy as np\nfrom motionary.files import save_array\narray = np.zeros(5000)"


@pytest.mark.parametrize(
    ("before", "block", "named"),
    [
        ("", 'with atomic_file("kept/a.txt") as file: file.write_bytes(bytes(5000))', "kept/a.txt"),
        ("", 'with atomic_folder("kept") as folder: (folder / "a.txt").write_bytes(bytes(5000))', "kept"),
        (MODEL, 'save_checkpoint(Path("kept/a.txt"), model, optimizer, {}, {})', "kept/a.txt"),
        (CLIP, 'write_video(clip, "kept/a.mp4")', "kept/a.mp4"),
        (CLIP, 'write_video(clip, "kept/a.gif")', "kept/a.gif"),
        (CLIP, 'clip.save("kept/a.glb")', "kept/a.glb"),
        (CLIP, 'clip.save("kept/a.npz")', "kept/a.npz"),
        (ARRAY, 'with atomic_folder("kept") as folder: save_array(folder / "a.npy", array)', "kept"),
        (ARRAY, 'with atomic_file("kept/a.npy") as file: save_array(file, array[:120])', "kept/a.npy"),
    ],
)
def test_a_full_disk_is_one_line_that_names_the_file(kept, before, block, named):
    """The kernel's limit on a file's size stands for a full disk: the write fails in the same place."""
    result = script(FULL.format(before=before, block=f"    {block}"), kept.parent)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith(f"{named}: ")
    assert "File too large" in result.stdout
    assert (kept / "a.txt").read_text() == "precious"
    assert names(kept) == ["a.txt"]
    assert names(kept.parent) == ["kept"]


def test_errors_of_other_files_stay_what_they_are(kept):
    with pytest.raises(PermissionError), atomic_file(kept / "a.txt"):
        raise PermissionError(13, "Permission denied", "/somewhere/else")
    with pytest.raises(FileNotFoundError), atomic_folder(kept):
        (kept / "no such file").read_text()


def test_places_that_cannot_be_written_are_named(kept):
    with pytest.raises(InputError, match="a folder"), atomic_file(kept):
        pass
    with pytest.raises(InputError, match="a file"), atomic_folder(kept / "a.txt"):
        pass
    with pytest.raises(InputError, match=r"a\.txt: a file"), atomic_folder(kept / "a.txt" / "b"):
        pass
    with pytest.raises(InputError, match="force"), atomic_file(kept / "a.txt", force=False):
        pass


def test_a_link_is_replaced_and_what_it_points_to_stays(kept):
    linked, file = kept.parent / "linked", kept.parent / "file"
    linked.symlink_to(kept)
    file.symlink_to(kept / "a.txt")
    with atomic_folder(linked) as folder:
        (folder / "b.txt").write_text("b")
    write_bytes(file, "new")
    assert not linked.is_symlink()
    assert names(linked) == ["b.txt"]
    assert (kept / "a.txt").read_text() == "precious"
    assert names(kept.parent) == ["file", "kept", "linked"]
