"""Cases of the dictionary in use: from the shell, and in the browser."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np

from motionary.bench.made import make_context
from motionary.bench.shapes import Shapes
from motionary.bench.workload import Work, clock


def shell(shapes: Shapes) -> Work:
    """Prompts of a file to motion files by `motionary generate`: Python's start, models and texts included."""
    folder = tempfile.TemporaryDirectory()
    root = Path(folder.name)
    prompts = _prompts(shapes.texts)
    (root / "prompts.txt").write_text("\n".join(prompts))
    _models(root / "models", shapes, prompts, shapes.width, shapes.gru_width, shapes.text_width, shapes.codes)
    command = [sys.executable, "-m", "motionary.cli", "generate", "--file", str(root / "prompts.txt"), "--force"]
    command += ["--models", str(root / "models"), "--system", "text2token", "--format", "npy", "--device", "cpu"]
    command += ["--seconds", f"{shapes.tokens * 0.2:g}", "--out", str(root / "out")]

    def run() -> None:
        """The command, as a shell starts it."""
        subprocess.run(command, check=True, capture_output=True)
        assert len(list((root / "out").iterdir())) == len(prompts), folder.name

    return Work(run)


def page(shapes: Shapes) -> Work:
    """`motionary app` from its start until the page is there; opening models behind it goes on and is cut off."""
    folder = tempfile.TemporaryDirectory()
    models = Path(folder.name) / "models"
    _models(models, shapes, _prompts(4), 16, 16, 8, 16)
    command = [sys.executable, "-m", "motionary.cli", "app", "--models", str(models), "--device", "cpu", "--port", "0"]
    waits: list[float] = []

    def run() -> None:
        """Starts the page, loads it once and stops it."""
        begun = time.monotonic()
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None, folder.name
            line = next(line for line in process.stdout if "motionary is at" in line)
            urllib.request.urlopen(line.split()[3], timeout=60).read()
            waits.append(time.monotonic() - begun)
            process.kill()

    return Work(run, lambda seconds: f"{clock(min(waits))} by the clock")


def first_frame(shapes: Shapes) -> Work:
    """A prompt, with the models of `scale=small` open, until its figure stands in a visitor's scene and moves."""
    from motionary import load
    from motionary.app.figures import Limbs

    folder = tempfile.TemporaryDirectory()
    models = Path(folder.name) / "models"
    prompts = _prompts(4)
    _models(models, shapes, prompts, shapes.small_width, shapes.small_gru_width, shapes.small_text_width, 512)
    dictionary = load(models, "cpu")
    dictionary.generate(prompts[0], system="text2token", seconds=1.0)

    def run() -> None:
        """A motion and its figure."""
        (motion,) = dictionary.generate(prompts[1], system="text2token", seconds=shapes.tokens * 0.2)
        figure = Limbs(_Scene(), folder.name, motion, np.zeros(3))
        figure.pose(1)

    return Work(run)


class _Scene:
    """Takes what would be sent to a browser."""

    def add_batched_meshes_simple(self, *given: Any, **more: Any) -> Any:
        """A node without effect."""
        return type("Node", (), {})()


def _prompts(count: int) -> list[str]:
    """Sentences of the demo grammar."""
    from motionary.corpus.demo import demo_clip

    found: list[str] = []
    index = 0
    while len(found) < count:
        found += demo_clip(index)[1]["captions"]
        index += 1
    return found[:count]


def _models(
    folder: Path, shapes: Shapes, prompts: list[str], width: int, gru_width: int, text_width: int, codes: int
) -> None:
    """A tokenizer and text2token of random weights that know the prompts' words, as a pipeline leaves them."""
    from dataclasses import replace

    from motionary.language import Vocabulary, annotate
    from motionary.systems.io import save_model
    from motionary.systems.tm2t.text2token import Text2Token, Text2TokenConfig
    from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

    os.environ["OMP_NUM_THREADS"] = "1"
    context = replace(make_context(shapes), vocabulary=Vocabulary.build(annotate(prompts)))
    tokens = Text2TokenConfig(
        codes, word_dim=shapes.word_dim, text_width=text_width, width=gru_width, max_tokens=shapes.tokens
    )
    tokenizer = TokenizerConfig(codebook_size=codes, code_dim=min(width, 1024), width=width, fine_width=0)
    for name, model in (("tokenizer", Tokenizer(tokenizer, context)), ("text2token", Text2Token(tokens, context))):
        save_model(folder / name, name, model, context)
