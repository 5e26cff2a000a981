"""The stages of action2motion as commands, on clips without an action: what is missing is said, the rest goes on."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest

from motionary.corpus.demo import demo_clip
from motionary.corpus.preprocess import preprocess
from motionary.errors import InputError
from motionary.pipeline.journal import WATCHED
from motionary.systems.io import open_system

pytestmark = pytest.mark.slow


def test_a_corpus_without_actions_runs_through(repository, tmp_path):
    clips = tmp_path / "clips"
    clips.mkdir()
    for i in range(4):
        demo_clip(i)[0].save(clips / f"{i}.npz")
    (clips / "clips.jsonl").write_text("".join(json.dumps({"motion": f"{i}.npz"}) + "\n" for i in range(4)))
    root = tmp_path / "project"
    for name in ("conf", "stages", "src"):
        shutil.copytree(repository / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    preprocess({"source": "folder", "roots": [str(clips)], "workers": 1}, root / "data/corpus", progress=False)
    for name in ("action_evaluator", "action2motion", "action_evaluation"):
        command = [sys.executable, f"stages/{name}.py", "threads=1", "device=cpu"]
        environment = os.environ | {"DVC_STAGE": name, "PYTHONPATH": str(root / "src"), WATCHED: "1"}
        done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr[-2000:]
        assert "the corpus names" in done.stdout
        assert json.loads((root / f"reports/{name}.json").read_text())["note"] in done.stdout
        assert (root / "reports/figures" / name).is_dir()
    with pytest.raises(InputError, match="names no action"):
        open_system("action2motion", "act", root / "models")
