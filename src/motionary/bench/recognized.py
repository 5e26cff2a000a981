"""Whether a judge knows a motion again that another rig performs: its rank among many by the distance of embeddings.

python -m motionary.bench.recognized rig/cc_02_01.bvh --among mocap/*.npy --fps 20
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motionary.dictionary import Dictionary, load
from motionary.errors import InputError, exit_code
from motionary.formats import read_motion
from motionary.report.table import Table


def recognized(
    dictionary: Dictionary,
    files: Sequence[str],
    among: Sequence[str],
    fps: float | None = None,
    shortest: float = 1.3,
    system: str | None = None,
) -> Table:
    """A row for each file: the rank (from 1) of the one of `among` whose name its own name ends with.

    Args:
        among: files, at `fps` where it is given, of which those of at least `shortest` seconds count.
        system: the judge that embeds them; None takes the usual one.

    Raises:
        InputError: a file that has no counterpart or several, and whatever cannot be read.
    """
    pool = {Path(file).stem: read_motion(file, fps=fps) for file in among}
    pool = {name: motion for name, motion in pool.items() if motion.duration >= shortest}
    wanted: list[str] = []
    for file in files:
        own = [name for name in pool if Path(file).stem.endswith(name)]
        if len(own) != 1:
            raise InputError(file, f"{len(own)} counterparts", "must end with the name of exactly one file of --among")
        wanted += own
    embedded = dictionary.embed(motions=list(pool.values()), system=system)
    asked = dictionary.embed(motions=[read_motion(file) for file in files], system=system)
    away = np.linalg.norm(asked[:, None] - embedded[None], axis=-1)
    names = list(pool)
    rows = []
    for file, name, row in zip(files, wanted, away, strict=True):
        nearest = ", ".join(names[i] for i in row.argsort(kind="stable")[:5])
        rows.append([Path(file).stem, f"{1 + int((row < row[names.index(name)]).sum())} of {len(names)}", nearest])
    return Table("Recognized", ["motion", "rank of its own", "nearest"], rows)


def main(arguments: Sequence[str]) -> int:
    """Prints the table; exit code 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m motionary.bench.recognized", description=__doc__)
    parser.add_argument("files", nargs="+", metavar="FILE")
    parser.add_argument("--among", nargs="+", required=True, metavar="FILE")
    parser.add_argument("--models", default="models", help="folder of trained models (default: %(default)s)")
    parser.add_argument("--system", help="the judge that embeds (default: the usual one)")
    parser.add_argument("--fps", type=float, help="rate of those of --among, whatever they say (npy says none)")
    options = parser.parse_args(arguments)

    def run() -> None:
        """The table of what was asked for."""
        table = recognized(load(options.models), options.files, options.among, options.fps, system=options.system)
        print(table.markdown(), end="")

    return exit_code(run)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
