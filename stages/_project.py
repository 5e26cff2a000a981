"""Imported first by every stage: finds the sources beside it, bounds how long threads spin, answers old keys."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))  # also in a queued copy of the project

# Threads that wait spin for a while before they sleep. Unbounded, two of them beside other busy processes take turns
# at doing nothing. OpenMP reads this when torch is imported.
if not {"OMP_WAIT_POLICY", "GOMP_SPINCOUNT"} & os.environ.keys():
    os.environ["GOMP_SPINCOUNT"] = "1000"

from motionary.systems.renamed import answer_old_overrides  # noqa: E402

answer_old_overrides(sys.argv[1:])
