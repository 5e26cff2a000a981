"""``make reruns``: how many stages of the pipeline the last commits would have run again.

A clone goes back commit by commit; a stage counts where the listing of its code differs from the one before. What DVC
would run after it, since its outputs changed, is not counted.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from motionary.pipeline.code import Code

REPOSITORY = Path(__file__).resolve().parents[1]


def git(folder: Path, *command: str) -> str:
    """What a command of git says."""
    return subprocess.run(["git", *command], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()


def listings(clone: Path, commit: str) -> dict[str, str]:
    """{stage, or stage@system: listing of its code} at a commit."""
    git(clone, "checkout", "-q", "-f", commit)
    code = Code(clone)
    return {name: code.listing(name) for name in code.names()}


def changed(before: dict[str, str], after: dict[str, str]) -> set[str]:
    """The stages that have another listing than before, or none before."""
    return {name.partition("@")[0] for name in after if after[name] != before.get(name)}


def main() -> int:
    """The command line: a line for each commit, and the mean."""
    parser = argparse.ArgumentParser(prog="python tests/reruns.py", description=(__doc__ or "").split("\n\n")[1])
    parser.add_argument("-n", type=int, default=40, help="commits that touch src/ or stages/ (default: %(default)s)")
    count = parser.parse_args().n
    counts = []
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder) / "clone"
        git(REPOSITORY, "clone", "-q", str(REPOSITORY), str(clone))
        commits = git(clone, "log", "--format=%H %P", f"-{count}", "--no-merges", "--", "src", "stages").splitlines()
        for commit, parent in map(str.split, commits):
            before, after = listings(clone, parent), listings(clone, commit)
            stages = changed(before, after)
            counts.append(len(stages))
            said = git(clone, "log", "-1", "--format=%h %s", commit)
            few = " ".join(sorted(stages)) if len(stages) < 6 else ""
            print(f"{len(stages):3d}  {said[:70]:70}  {few}", flush=True)
    stages = {name.partition("@")[0] for name in after}
    print(f"{statistics.mean(counts):.1f} of {len(stages)} stages in the mean of {len(counts)} commits")
    return 0


if __name__ == "__main__":
    sys.exit(main())
