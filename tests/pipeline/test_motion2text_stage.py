"""The captioner's stage as a command run by two processes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest
import torch
from tiny import build_pipeline
from torch.nn.utils import parameters_to_vector

from motionary.corpus.store import Corpus
from motionary.corpus.token_store import TokenStore
from motionary.pipeline.code import code_hash
from motionary.pipeline.journal import WATCHED
from motionary.systems.io import load_model, open_system

pytestmark = pytest.mark.slow


def test_two_processes_train_every_member(repository, tmp_path):
    root = build_pipeline(tmp_path / "project", clips=40)
    for name in ("conf", "stages", "src"):
        shutil.copytree(repository / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    corpus, tokenizer = Corpus.open(root / "data/corpus"), load_model(root / "models/tokenizer")
    with torch.no_grad():
        codes = [
            tokenizer.encode(torch.tensor(f[None, : len(f) // 4 * 4]), torch.tensor([len(f) // 4 * 4]))[0].numpy()
            for f in (corpus.features(i) for i in range(len(corpus)))
        ]
    TokenStore.collect(codes).save(root / "models/tokenizer")

    small = [
        "steps=3",
        "log_every=1",
        "batch_size=4",
        "validate_every=3",
        "width=16",
        "num_layers=1",
        "dim_feedforward=16",
        "num_heads=2",
    ]
    settings = [f"motion2text.{s}" for s in (*small, "offsets=2", "ensemble=2", "wording=written")]
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
    command = [*launch, "stages/motion2text.py", *settings, "scale=tiny", "threads=1", "device=cpu"]
    environment = os.environ | {"DVC_STAGE": "motion2text", "PYTHONPATH": str(root / "src"), WATCHED: "1"}
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    captioner = open_system("motion2text", "motion_to_text", root / "models")
    assert captioner.written
    assert all("walks" in member.context.vocabulary for member in captioner.members)  # words as people wrote them
    first, second = (parameters_to_vector(m.parameters()) for m in captioner.members)
    assert not torch.allclose(first, second, atol=0.05)
    report = json.loads((root / "reports/motion2text.json").read_text())
    assert report.pop("code") == code_hash(root, "motion2text")
    assert {name: losses["steps"] for name, losses in report.items()} == {"training": 3, "member_2": 3}
    figures = {path.name for path in (root / "reports/figures/motion2text").iterdir()}
    assert {"curves.csv", "curves.png", "member_2_curves.csv", "member_2_curves.png"} <= figures
    assert not list((root / "models").glob(".*"))  # nothing half-written
