"""The stages of stylization as commands, on clips without a style label: what is missing is said, the rest runs."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest

from motionary.corpus.demo import demo_clip
from motionary.corpus.preprocess import preprocess
from motionary.pipeline.journal import WATCHED
from motionary.systems.io import open_system

pytestmark = pytest.mark.slow


def test_without_style_labels_the_unsupervised_setting_is_trained(repository, tmp_path):
    """One line names what the supervised setting lacks; asked for alone, it is an error; the rest can be used."""
    clips = tmp_path / "clips"
    clips.mkdir()
    for i in range(8):
        demo_clip(i)[0].save(clips / f"{i}.npz")
    lines = [json.dumps({"motion": f"{i}.npz", "captions": []}) for i in range(8)]
    (clips / "clips.jsonl").write_text("\n".join(lines) + "\n")
    root = tmp_path / "project"
    for name in ("conf", "stages", "src"):
        shutil.copytree(repository / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    preprocess({"source": "folder", "roots": [str(clips)], "workers": 1}, root / "data/corpus", progress=False)

    def stage(name: str, *settings: str) -> subprocess.CompletedProcess:
        small = [f"{name}.{s}" for s in ("steps=2", "batch_size=2", "validate_every=2", "width=8", *settings)]
        command = [sys.executable, f"stages/{name}.py", *small, "threads=1", "device=cpu"]
        environment = os.environ | {"DVC_STAGE": name, "PYTHONPATH": str(root / "src"), WATCHED: "1"}
        return subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=600)

    for name, settings in (("latents", ["code_dim=8"]), ("global_motion", []), ("stylization", ["style_dim=4"])):
        done = stage(name, *settings)
        assert done.returncode == 0, done.stderr[-2000:]
    assert "supervised stylization is left out: the corpus has no style labels" in done.stderr
    stylizer = open_system("stylization", "stylize", root / "models")
    assert set(stylizer.stylizers) == {"unsupervised"}
    assert json.loads((root / "reports/stylization.json").read_text())["unsupervised"]["steps"] == 2
    alone = stage("stylization", "settings=[supervised]")
    assert alone.returncode == 2
    assert "error: stylization.settings" in alone.stderr
