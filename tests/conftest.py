"""Shared fixtures. One thread per process: two test processes with two threads each would collapse on two cores."""

from __future__ import annotations

import os
import sys

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # with --import-mode=importlib pytest does not
pytest_plugins = ["tiny", "made_batches"]

REPOSITORY = Path(__file__).resolve().parents[1]
SHARED_DATA = REPOSITORY.parent / "shared" / "data"


def pytest_collection_modifyitems(items):
    """The files that take longest come first, so that no worker is left with them at the end. Real-data tests run
    whenever the folder is there; where it is not, they say what is missing."""
    items.sort(key=lambda item: item.path.parent.name not in ("pipeline", "study", "app"))
    if SHARED_DATA.is_dir():
        return
    missing = pytest.mark.skip(reason="real clips not found at ../shared/data")
    for item in items:
        if "real" in item.keywords:
            item.add_marker(missing)


def pytest_report_header():
    state = "found" if SHARED_DATA.is_dir() else "NOT FOUND: tests marked 'real' are skipped"
    return f"real clips at ../shared/data: {state}"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real motion data beside the repository (use with the marker `real`)."""
    return SHARED_DATA


@pytest.fixture(scope="session")
def repository() -> Path:
    """The root of this repository."""
    return REPOSITORY
