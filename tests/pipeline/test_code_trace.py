"""What DVC hashes of the code for a stage is all that the stage loads or reads: every stage is run and watched."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from acclaim_files import HEADER

from motionary.corpus.demo import demo_clip
from motionary.pipeline.code import INFRASTRUCTURE, Code
from motionary.pipeline.journal import WATCHED
from motionary.pipeline.params import write_params
from motionary.study.experiments import paths_of, read_pipeline, with_values

pytestmark = pytest.mark.slow

TRACED = Path(__file__).parent / "traced"
TRAINED = ("autoencoder", "tokenizer", "evaluator", "motion2text", "text2token", "inverse_alignment", "text2length")
TRAINED += ("text2motion", "latents", "global_motion", "stylization", "style_evaluator", "joint_evaluator")
TRAINED += ("action_evaluator", "action2motion", "temos", "residual_tokenizer")
TRAINED += ("masked_generator", "masked_autoregression")
SMALL = {
    "autoencoder": {"width": 8, "code_dim": 8},
    "tokenizer": {"codebook_size": 8, "code_dim": 8, "width": 8, "fine_width": 8},
    "evaluator": {"text_width": 8, "motion_width": 8, "dim": 8},
    "joint_evaluator": {"width": 8, "num_heads": 2, "num_layers": 1, "dim": 8},
    "motion2text": {"width": 8, "num_heads": 2, "num_layers": 1, "dim_feedforward": 8, "max_words": 4}
    | {"offsets": 2, "ensemble": 2},
    "text2token": {"text_width": 8, "width": 8, "max_tokens": 10},
    "text2length": {"text_width": 8},
    "text2motion": {"text_width": 8, "width": 8, "attention_width": 8, "latent": 4},
    "temos": {"latent": 8, "num_layers": 1, "num_heads": 2, "dim_feedforward": 8},
    "residual_tokenizer": {"codebook_size": 8, "code_dim": 8, "width": 8, "fine_width": 8},
    "masked_generator": {"width": 8, "num_layers": 1, "detail_layers": 1, "num_heads": 2, "dim_feedforward": 8},
    "masked_autoregression": {"width": 8, "num_layers": 1, "num_heads": 2, "dim_feedforward": 8, "head_width": 8},
    "latents": {"width": 8, "code_dim": 8},
    "global_motion": {"width": 8},
    "stylization": {"width": 8, "content_dim": 8, "style_dim": 8},
    "style_evaluator": {"width": 8, "dim": 8, "window": 64},
    "style_evaluation": {"repetitions": 1, "contents": 2, "diversity_contents": 1, "diversity_samples": 2, "codes": 8},
    "action_evaluator": {"width": 8, "dim": 4, "window": 24},
    "action2motion": {"width": 8, "latent": 4, "upstream": 4, "window": 24, "fine_variants": ["plain"]},
    "action_evaluation": {"repetitions": 1, "samples": 4, "locomotion_samples": 4, "physics_motions": 2},
    "evaluation": {
        "repetitions": 1,
        "multimodality_texts": 1,
        "multimodality_samples": 2,
        "multimodality_pairs": 1,
        "prompt_samples": 1,
        "position_samples": 1,
    },
    "report": {"examples": 1},
}
SMALL |= {name: SMALL.get(name, {}) | {"steps": 1, "batch_size": 2, "validate_every": 1} for name in TRAINED}
# Loaded everywhere without being part of any stage's code, and why that changes no outcome.
EXEMPT = {
    "stages/_project.py": "names the root of the checkout",
    "src/hydra_plugins/motionary_paths.py": "works on the configuration, whose values DVC compares",
    "src/hydra_plugins/motionary_opened.py": "works on the configuration, whose values DVC compares",
    "src/motionary/training/settings.py": "without training, names of keys only",
    "src/motionary/systems/renamed.py": "without models, refuses old names of keys",
}

# Called by infrastructure, which writes, lists and hashes files by it; what a stage's own code uses of it is hashed.
FOR_INFRASTRUCTURE = "src/motionary/files.py"

# Test data -----------------------------------------------------------------------------------------------------------

ASF = (
    HEADER
    + """\
:bonedata
{bones}:hierarchy
  begin
    root lhipjoint rhipjoint lowerback
    lhipjoint lfemur
    lfemur ltibia
    ltibia lfoot
    lfoot ltoes
    rhipjoint rfemur
    rfemur rtibia
    rtibia rfoot
    rfoot rtoes
    lowerback upperback
    upperback thorax
    thorax lowerneck lclavicle rclavicle
    lowerneck upperneck
    upperneck head
    lclavicle lhumerus
    lhumerus lradius
    lradius lwrist
    rclavicle rhumerus
    rhumerus rradius
    rradius rwrist
  end
"""
)
BONES = {  # of one side: direction and length
    "hipjoint": ((0.6, -0.8, 0), 2), "femur": ((0, -1, 0), 7), "tibia": ((0, -1, 0), 7), "foot": ((0, -0.3, 1), 2),
    "toes": ((0, 0, 1), 1), "clavicle": ((1, 0.2, 0), 3), "humerus": ((1, 0, 0), 5), "radius": ((1, 0, 0), 3),
    "wrist": ((1, 0, 0), 2),
}  # fmt: skip
SPINE = ("lowerback", "upperback", "thorax", "lowerneck", "upperneck", "head")


def acclaim(folder: Path) -> str:
    """A skeleton as CMU's and a motion in which it moves forward; the motion's name."""
    bones = {name: ((0, 1, 0), 2) for name in SPINE}
    for side, sign in (("l", 1), ("r", -1)):
        bones |= {side + name: ((sign * x, y, z), length) for name, ((x, y, z), length) in BONES.items()}
    text = "".join(
        f"  begin\n     id {i}\n     name {name}\n     direction {x} {y} {z}\n     length {length}\n"
        "     axis 0 0 0  XYZ\n  end\n"
        for i, (name, ((x, y, z), length)) in enumerate(bones.items(), 1)
    )
    (folder / "01.asf").write_text(ASF.format(bones=text))
    frames = "".join(f"{i + 1}\nroot 0 17 {0.1 * i} 0 0 0\n" for i in range(360))
    (folder / "01_01.amc").write_text(":FULLY-SPECIFIED\n:DEGREES\n" + frames)
    return "01_01.amc"


def write_clips(folder: Path) -> None:
    """A folder of clips in every format that can be read."""
    folder.mkdir()
    names = [acclaim(folder)]
    for index, ending in enumerate(("bvh", "npz", "npy", "bvh", "npz", "npy")):
        names.append(f"{index}.{ending}")
        demo_clip(index)[0].save(folder / names[-1])
    lines = [
        {"motion": name, "fps": 120 if "amc" in name else 20, "captions": [{"text": "a person walks"}]}
        for name in names
    ]
    (folder / "clips.jsonl").write_text("\n".join(map(json.dumps, lines)) + "\n")


def write_release(folder: Path) -> None:
    """The layout of HumanML3D."""
    for name in ("new_joints", "texts"):
        (folder / name).mkdir(parents=True)
    for index in range(4):
        np.save(folder / "new_joints" / f"{index:06d}.npy", demo_clip(index)[0].positions)
        (folder / "texts" / f"{index:06d}.txt").write_text("a person walks#a/DET person/NOUN walk/VERB#0.0#0.0\n")
    for split, names in (("train", "000000\n000001"), ("val", "000002"), ("test", "000003")):
        (folder / f"{split}.txt").write_text(names + "\n")


# Watching ------------------------------------------------------------------------------------------------------------


def jobs(root: Path, logs: Path, data: str, *overrides: str, only: tuple[str, ...] = ()) -> list[dict]:
    """The stages in the order of the map, with the paths that they read and write."""
    config = f"params_{data}"
    write_params(root, root / f"{config}.yaml", [f"data={data}", "scale=micro", "threads=1", *overrides])
    params = yaml.safe_load((root / f"{config}.yaml").read_text())
    pipeline = read_pipeline(root)
    command = pipeline["vars"][0]["composed"].replace("--config-name params", f"--config-name {config}")
    listed = []
    for name, stage in with_values(pipeline, params)["stages"].items():
        stem = name.split("@")[0]
        if stem != "code" and (not only or stem in only):
            writes = paths_of(stage, "outs", "metrics")
            job = {"name": name, "command": stage["cmd"].replace("${composed}", command), "writes": writes}
            log = logs / f"{data} {stem if stem == 'source' else name}"
            listed.append(job | {"log": str(log), "uses": [*writes, *paths_of(stage, "deps")]})
    return listed


def in_order(listed: list[dict]) -> list[dict]:
    """Each with the numbers of those before it that write what it uses."""

    def touch(a: str, b: str) -> bool:
        return f"{a}/".startswith(f"{b}/") or f"{b}/".startswith(f"{a}/")

    for number, job in enumerate(listed):
        job["needs"] = [n for n in range(number) if any(touch(a, b) for a in listed[n]["writes"] for b in job["uses"])]
    return listed


@pytest.fixture(scope="module")
def loaded(repository, tmp_path_factory) -> tuple[Path, dict[str, set[str]]]:
    """The project, and the files of it that each stage (as `Code.names` has it) loaded or read on any corpus, with the
    functions and classes that it called as ``file:name``."""
    home = tmp_path_factory.mktemp("traced")
    root, logs = home / "project", home / "logs"
    logs.mkdir()
    for name in ("conf", "stages", "src"):
        shutil.copytree(repository / name, root / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    shutil.copy(repository / "dvc.yaml", root)
    (root / "conf/scale/micro.yaml").write_text("# @package _global_\n" + yaml.safe_dump({"scale": "micro"} | SMALL))
    shutil.copy(repository / "params.yaml", root)
    write_clips(home / "clips")
    write_release(home / "release")
    ratios, first = "data.ratios=[0.6,0.2,0.2]", ("source", "preprocess")
    listed = [
        *jobs(root, logs, "folder", f"data.roots=[{home / 'clips'}]", "data.workers=1", only=first),
        *jobs(root, logs, "humanml3d", f"data.roots=[{home / 'release'}]", "data.workers=1", only=first),
        *jobs(root, logs, "demo", "data.clips=40", "data.workers=2", ratios),
    ]
    (home / "jobs.json").write_text(json.dumps(in_order(listed)))
    paths = os.pathsep.join((str(root / "src"), str(TRACED)))
    environment = os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""}
    environment[WATCHED] = "1"  # and nobody watches: tracking is none of this
    command = [sys.executable, str(TRACED / "run_stages.py"), str(root), str(home / "jobs.json")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    found: dict[str, set[str]] = {}
    for log in logs.iterdir():
        name = log.name.split(" ")[1]
        lines = {line for line in log.read_text().splitlines() if line.split("/")[0] in ("src", "stages", "conf")}
        found.setdefault(name, set()).update(line for line in lines if (root / line.split(":")[0]).is_file())
    return root, found


def test_all_that_a_stage_loads_is_hashed(loaded):
    root, found = loaded
    code = Code(root)
    missing = {}
    for name, files in found.items():
        hashed = code.files(name) | INFRASTRUCTURE | set(EXEMPT)
        opened = {file for file in files if ":" not in file}
        missing[name] = sorted(file for file in opened if not {file, str(Path(file).parent)} & hashed)
    assert {name: files for name, files in missing.items() if files} == {}
    assert all("src/motionary/training/settings.py" in code.files(name) for name in TRAINED)


def test_all_that_a_stage_calls_is_hashed(loaded):
    root, found = loaded
    code, exempt = Code(root), INFRASTRUCTURE | set(EXEMPT) | {FOR_INFRASTRUCTURE}
    called = {name: {line for line in lines if ":" in line} for name, lines in found.items()}
    assert all(len(places) > 50 for places in called.values())
    assert "src/motionary/files.py:atomic_folder" in called["preprocess"]
    missing = {name: sorted(places - code.places(name)) for name, places in called.items()}
    missing = {name: [p for p in places if p.split(":")[0] not in exempt] for name, places in missing.items()}
    assert {name: places for name, places in missing.items() if places} == {}


def test_every_stage_and_every_reader_was_seen(loaded):
    root, found = loaded
    systems = yaml.safe_load((root / "params.yaml").read_text())["evaluation"]["systems"]
    expected = {name for name in Code(root).names() if "@" not in name} | {f"evaluation@{name}" for name in systems}
    assert found.keys() == expected
    readers = ("formats/read/bvh", "formats/read/acclaim", "formats/read/arrays", "corpus/released", "corpus/demo/gait")
    assert {f"src/motionary/{name}.py" for name in readers} <= found["preprocess"]
    assert "src/motionary/systems/tm2t/captioner.py" in found["evaluation@motion2text"]
    assert "src/motionary/formats/render/player.js" in found["report"]
