"""What tests of the shell share."""

from __future__ import annotations

from pathlib import Path

import pytest

from motionary.corpus.demo import demo_clip


@pytest.fixture
def clip(tmp_path) -> Path:
    """A BVH of the demo corpus."""
    path = tmp_path / "given.bvh"
    demo_clip(3)[0].save(path)
    return path


@pytest.fixture
def models(pipeline) -> list[str]:
    """The options that name untrained models."""
    return ["--models", str(pipeline / "models"), "--device", "cpu"]
