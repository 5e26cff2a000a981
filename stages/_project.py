"""The root of this checkout; importing this first makes a stage use the sources beside it, also in a queued copy."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))
