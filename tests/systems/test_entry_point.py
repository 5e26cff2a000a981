"""A system of another package: installed beside this one, found by its entry point, asked like any other."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from motionary import read_motion

CODE = '''
"""A generator that slides a standing body along x, as far as its one weight says."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from motionary.motion import Motion
from motionary.systems.registry import TEXT_TO_MOTION, System


@dataclass(frozen=True)
class SliderConfig:
    frames: int


class Slider(nn.Module):
    def __init__(self, config, context):
        super().__init__()
        self.config, self.context = config, context
        self.speed = nn.Parameter(torch.zeros(()))


class Generator:
    """Hands out motions of its own, not features of the corpus."""

    takes_lengths = True

    def __init__(self, model):
        self.model, self.context = model, model.context

    def generate(self, sentences, seeds, frames=None, **options):
        lengths = frames or [self.model.config.frames] * len(sentences)
        return [self.slide(sentence, length) for sentence, length in zip(sentences, lengths, strict=True)]

    def slide(self, sentence, length):
        rest = self.context.skeleton.offsets
        standing = np.zeros_like(rest)
        for joint, parent in enumerate(self.context.skeleton.parents):
            standing[joint] = rest[joint] + (standing[parent] if parent >= 0 else 0)
        positions = np.repeat((standing - standing.min(0) * [0, 1, 0])[None], length, 0)
        speed = float(self.model.speed) * len(sentence.normalized.split())
        positions[..., 0] += speed * np.arange(length)[:, None] / self.context.fps
        return Motion(positions, self.context.fps, self.context.skeleton)


def open_generator(trained, name):
    return Generator(trained.load(name))


SLIDER = System(
    "slider", "slides", "system.Slider", "system.SliderConfig", offers={TEXT_TO_MOTION: "open_generator"},
    package="slides",
)
'''

SAVED = """
import sys
import torch
from motionary.corpus.store import Corpus
from motionary.systems.io import save_model
from slides.system import Slider, SliderConfig

model = Slider(SliderConfig(30), Corpus.open(sys.argv[1]).context)
model.speed.data.fill_(0.25)
save_model(sys.argv[2], "slider", model, model.context)
"""

ASKED = """
import json, sys
import motionary
from motionary.systems.registry import TEXT_TO_MOTION

d = motionary.load(sys.argv[1], "cpu")
(motion,) = d.generate("a person walks", seconds=2, system="slider", feet=False)
try:
    d.generate("a person walks", system="slide")
except motionary.InputError as error:
    said = str(error)
moved = float((motion.positions[-1, :, 0] - motion.positions[0, :, 0]).mean())
print(json.dumps([type(motion).__name__, motion.frames, moved, d.offering(TEXT_TO_MOTION), said]))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """A folder of packages as pip leaves them: the code, and beside it what is known of the distribution."""
    site = tmp_path_factory.mktemp("site")
    (site / "slides").mkdir()
    (site / "slides/__init__.py").touch()
    (site / "slides/system.py").write_text(CODE)
    about = site / "slides-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: slides\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[motionary.systems]\nslider = slides.system:SLIDER\n")
    return site


@pytest.fixture(scope="module")
def models(installed, pipeline, tmp_path_factory) -> Path:
    """Models of that system alone, saved as those of this project are."""
    folder = tmp_path_factory.mktemp("elsewhere") / "models"
    done = python(installed, "-c", SAVED, str(pipeline / "data/corpus"), str(folder / "slider"))
    assert done.returncode == 0, done.stderr
    return folder


def python(site: Path, *arguments: str) -> subprocess.CompletedProcess:
    """Python in a process that finds the packages of `site`."""
    path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))
    line = [sys.executable, *arguments]
    return subprocess.run(line, capture_output=True, text=True, timeout=600, env=os.environ | {"PYTHONPATH": path})


def test_the_shell_generates_with_it(installed, models, tmp_path):
    out = ["--models", str(models), "--device", "cpu", "--out", str(tmp_path)]
    line = [
        "-m",
        "motionary.cli",
        "generate",
        "a person walks",
        "--seconds",
        "2",
        "--system",
        "slider",
        "--no-feet",
        *out,
    ]
    done = python(installed, *line)
    assert (done.returncode, done.stdout) == (0, f"{tmp_path}/a-person-walks.bvh\n"), done.stderr
    motion = read_motion(tmp_path / "a-person-walks.bvh")
    assert (motion.frames, motion.fps) == (40, pytest.approx(20))
    moved = motion.positions - motion.positions[:1]
    slid = np.arange(40)[:, None] * 3 * 0.25 / 20  # "a person walk": three words
    np.testing.assert_allclose(moved[..., 0], np.broadcast_to(slid, (40, 22)), atol=1e-3)
    np.testing.assert_allclose(moved[..., 1:], 0, atol=1e-3)


def test_python_asks_it_and_what_is_unknown_lists_it(installed, models):
    done = python(installed, "-c", ASKED, str(models))
    assert done.returncode == 0, done.stderr
    kind, frames, moved, generators, said = json.loads(done.stdout)
    assert (kind, frames, generators) == ("Motion", 40, ["slider"])
    assert moved == pytest.approx(39 * 3 * 0.25 / 20, abs=1e-4)
    assert said == "system: slide: must be one of slider"


def test_without_its_package_its_models_are_left_alone(installed, models):
    line = ["generate", "walk", "--system", "slider", "--models", str(models)]
    bare = subprocess.run([sys.executable, "-m", "motionary.cli", *line], capture_output=True, text=True)
    assert bare.returncode == 2
    assert bare.stderr.startswith(f"error: {models}: empty: holds no trained model")


@pytest.mark.parametrize(
    ("point", "rule"),
    [
        ("slides.system:MISSING", "error: entry point slider: slides.system:MISSING: cannot be loaded: "),
        ("slides.nowhere:SLIDER", "error: entry point slider: slides.nowhere:SLIDER: cannot be loaded: "),
        ("slides.system:Slider", "error: entry point slider: slides.system:Slider: must name a "),
    ],
)
def test_a_broken_entry_point_is_one_line(installed, models, tmp_path, point, rule):
    broken = tmp_path / "broken-1.0.dist-info"
    broken.mkdir()
    (broken / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (broken / "entry_points.txt").write_text(f"[motionary.systems]\nslider = {point}\n")
    (tmp_path / "slides").symlink_to(installed / "slides")
    done = python(tmp_path, "-m", "motionary.cli", "generate", "walk", "--models", str(models))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(rule)
    assert done.stderr.count("\n") == 1
