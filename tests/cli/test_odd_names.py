"""Names of files as no one should give them: the result, or one short line without a number of the system's."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from motionary.cli import main
from motionary.corpus.demo import demo_clip
from motionary.formats import write_motion


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    return write_motion(demo_clip(3)[0], tmp_path_factory.mktemp("odd") / "walk.npz")


@pytest.mark.parametrize("name", ["a" * 10_000 + ".npz", "\u00e9" * 200 + ".npz", "loop.npz", "/proc/x.npz", ""])
def test_a_name_that_cannot_be(walk, tmp_path, capsys, name):
    (tmp_path / "loop.npz").symlink_to(tmp_path / "loop.npz")
    odd = str(tmp_path / name) if name else ""
    commands = [["inspect", odd], ["convert", str(walk), str(tmp_path / "o.npz"), "--mapping", odd]]
    if name != "loop.npz":  # as a place to write, a link is replaced
        commands.append(["convert", str(walk), odd])
    for command in commands:
        assert main(command) == 2
        said = capsys.readouterr().err
        assert said.startswith("error: ")
        assert said.count("\n") == 1
        assert len(said) < 1500
        assert "Errno" not in said


def test_a_name_that_is_no_text_is_read_and_printed_as_it_is(walk, tmp_path):
    """A file's name is bytes; what is printed opens the file again."""
    odd = os.fsencode(tmp_path) + b"/n\xffme.npz"
    made = os.fsencode(tmp_path) + b"/m\xfede.bvh"
    with open(odd, "wb") as file:
        file.write(walk.read_bytes())
    command = [sys.executable, "-m", "motionary.cli"]
    done = subprocess.run([*command, "convert", odd, made], capture_output=True, check=True)
    assert done.stdout.strip() == made
    assert os.path.getsize(made) > 1000
    page = os.fsencode(tmp_path) + b"/p\xfde.html"
    subprocess.run([*command, "view", odd, "--no-open", "--out", page], capture_output=True, check=True)
    with open(page, "rb") as file:
        assert b"n\\udcffme" in file.read()
