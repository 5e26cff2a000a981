"""--onto: files of the shell on a character's own rig."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.cli import main
from motionary.cli.command import build_parser
from motionary.cli.commands import COMMANDS
from motionary.corpus.demo import demo_clips
from motionary.formats import read_motion
from motionary.formats.gltf_container import packed
from motionary.formats.gltf_file import GltfFile
from motionary.motion import Skeleton, fit_rotations, retarget


@pytest.fixture
def files(tmp_path):
    motion = fit_rotations(next(iter(demo_clips(1)))[0])
    motion.save(tmp_path / "walk.npz")
    smpl = Skeleton.named("smpl22")
    character = fit_rotations(retarget(motion, smpl.with_offsets(smpl.offsets * 0.8)))
    character.save(tmp_path / "character.bvh")
    character.save(tmp_path / "character.glb")
    return tmp_path, motion


@pytest.mark.parametrize("extension", ["bvh", "glb", "npz"])
def test_convert_writes_onto_a_rig(files, capsys, extension):
    folder, motion = files
    target = folder / f"out.{extension}"
    onto = folder / ("character.glb" if extension == "glb" else "character.bvh")
    assert main(["convert", str(folder / "walk.npz"), str(target), "--onto", str(onto)]) == 0
    assert capsys.readouterr().out.strip() == str(target)
    if extension == "glb":
        return
    found, wanted = (
        read_motion(target, skip_first=False) if extension == "bvh" else read_motion(target),
        motion.to(onto),
    )
    np.testing.assert_allclose(found.positions, wanted.positions, atol=1e-4)


def test_what_is_no_rig_is_said_in_one_line(files, capsys):
    folder, _ = files
    assert main(["convert", str(folder / "walk.npz"), str(folder / "out.bvh"), "--onto", str(folder / "walk.npz")]) == 2
    assert "must be a .bvh or .glb file" in capsys.readouterr().err
    assert not (folder / "out.bvh").exists()


def _changed(node=None, **parts):
    """Changes a character's document: its fourth joint's node, or the document itself."""

    def change(document):
        document["nodes"][document["skins"][0]["joints"][3]] |= node or {}
        return document | parts

    return change


ALONE = {"asset": {"version": "2.0"}, "nodes": [{"children": [0]}], "skins": [{"joints": [0]}]}
CHAIN = {"nodes": [{"children": [i + 1]} for i in range(19999)] + [{}], "skins": [{"joints": [*range(19600, 20000)]}]}


@pytest.mark.parametrize("extension", ["bvh", "glb"])
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda _: ALONE, "node 0, children"),
        (lambda document: document | CHAIN, "roles of no known joint"),
        (_changed({"children": [3]}), "children"),
        (_changed({"children": 5}), "children: 5"),
        (_changed({"translation": "x"}), "translation: x"),
        (_changed({"translation": True}), "translation: True"),
        (_changed({"translation": [10**400, 0, 0]}), "translation"),
        (_changed({"scale": [0, 0, 0]}), "scale: "),
        (_changed({"scale": [-1, 1, 1]}), "scale: "),
        (_changed({"rotation": [0, 0, 0, 0]}), "rotation: "),
        (_changed(skins=None), "skins: None"),
        (_changed(skins=[{"joints": "x"}]), "skin 0, joints: x"),
        (_changed(accessors=None), "accessors: None"),
        (_changed(asset={}), "version None"),
        (_changed(buffers=[{"uri": "x.bin", "byteLength": 4}]), "must lie inside the .glb"),
    ],
)
def test_a_damaged_character_is_said_in_one_line(files, capsys, extension, change, said):
    folder, _ = files
    file = GltfFile.read(folder / "character.glb")
    document, data = file.document, file.data
    (folder / "rig.glb").write_bytes(packed(change(document), data))
    target = folder / f"out.{extension}"
    assert main(["convert", str(folder / "walk.npz"), str(target), "--onto", str(folder / "rig.glb")]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {folder / 'rig.glb'}")
    assert said in error
    assert error.count("\n") == 1
    assert not target.exists()


@pytest.mark.parametrize(
    "line",
    [
        ["generate", "a person walks"],
        ["stylize", "in.bvh"],
        ["act", "walk"],
        ["edit", "in.bvh", "--extend", "1"],
        ["convert", "in.bvh", "out.bvh"],
    ],
)
def test_whatever_writes_motion_takes_a_rate_and_a_rig(line):
    options = build_parser(COMMANDS).parse_args([*line, "--fps", "24", "--onto", "character.bvh"])
    assert (options.fps, options.onto) == (24.0, "character.bvh")


def test_a_rate_and_a_rig_go_together(files):
    folder, motion = files
    character = str(folder / "character.bvh")
    line = ["convert", str(folder / "walk.npz"), str(folder / "out.npz"), "--onto", character, "--fps", "60"]
    assert main(line) == 0
    found = read_motion(folder / "out.npz")
    assert found.fps == 60.0
    assert found.duration == pytest.approx(motion.duration, abs=1 / motion.fps)
    np.testing.assert_allclose(found.skeleton.offsets, read_motion(character).skeleton.offsets, atol=1e-4)
