"""What retargeting leaves: how two takes of one motion differ on one body, and what a way onto a rig and back costs.

``python -m motionary.bench.rig_trips twins cc_02_01.bvh captioned/02_01.npy`` prints mm by joint, root and heading
removed: of each joint's mean place (what a mapping of rest poses could still mend) and around it (what moves otherwise
in the two files, which no constant mapping can mend). ``... trips FILE ...`` prints degrees by joint after the way onto
smpl22 and back, metres of the feet, and how much more or less feet slide.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from motionary.errors import exit_code
from motionary.formats import read_motion
from motionary.metrics import foot_skating
from motionary.motion import Motion, Skeleton, heading, resample, retarget
from motionary.motion.facing import rotate_y
from motionary.motion.rigging import Rig, to_rig
from motionary.report.table import Table

_FPS = 20.0


def local(motion: Motion) -> np.ndarray:
    """(T, J, 3) positions in metres, root and heading removed."""
    positions = motion.positions.astype(np.float64)
    return rotate_y(positions - positions[:, :1], -heading(motion)[:, None])


def twins(first: Motion, second: Motion) -> Table:
    """Two recordings of one motion on smpl22: how far apart each joint is, at the same rate and frames."""
    body = Skeleton.named("smpl22")
    a, b = (local(retarget(resample(motion, _FPS), body)) for motion in (first, second))
    frames = min(len(a), len(b))
    apart = a[:frames] - b[:frames]
    mean = apart.mean(0)
    columns = [np.linalg.norm(x, axis=-1) for x in (apart, apart - mean)]
    values = np.stack([columns[0].mean(0), np.linalg.norm(mean, axis=-1), columns[1].mean(0)], -1) * 1000
    rows = [[name, *(f"{x:.1f}" for x in row)] for name, row in zip(body.joints, values, strict=True)]
    total = [f"{x:.1f}" for x in values.mean(0)]
    return Table(
        "Two takes on one body, mm", ["joint", "apart", "of the mean place", "around it"], [*rows, ["all", *total]]
    )


def trips(motion: Motion) -> Table:
    """Onto smpl22 and back to the motion's own rig: degrees of the joints that have a role, at the 95th percentile."""
    own = resample(motion, _FPS)
    there = own.to(Skeleton.named("smpl22"))
    back = to_rig(there, Rig.of(own.skeleton, own.rotations))
    own = own if own.rotations is not None else back
    assert own.rotations is not None
    assert back.rotations is not None
    cosine = np.abs((own.rotations.astype(np.float64) * back.rotations).sum(-1))
    degrees = np.degrees(2 * np.arccos(np.clip(cosine, 0, 1)))
    rows = []
    for role, joint in own.skeleton.roles.items():
        rows.append([role, f"{degrees[:, joint].mean():.2f}", f"{np.percentile(degrees[:, joint], 95):.2f}"])
    used = degrees[:, list(own.skeleton.roles.values())]
    rows.append(["all", f"{used.mean():.2f}", f"{np.percentile(used, 95):.2f}"])
    feet = np.linalg.norm((back.positions - own.positions)[:, list(own.skeleton.feet)], axis=-1)
    slide = [foot_skating(each) for each in (own, there, back)]
    note = f"feet {np.percentile(feet, 95) * 1000:.1f} mm at the 95th percentile; skating, m/s: "
    note += f"{slide[0]:.3f} in the file, {slide[1]:.3f} on smpl22, {slide[2]:.3f} back"
    return Table("Onto smpl22 and back, degrees", ["joint", "mean", "p95"], rows, note)


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints a table for each pair or file; exit code 2 and one line on bad input."""
    parser = argparse.ArgumentParser(prog="python -m motionary.bench.rig_trips", description=__doc__)
    parser.add_argument("what", choices=("twins", "trips"))
    parser.add_argument("files", nargs="+", metavar="FILE", help="motion files; twins in pairs, one after the other")
    parser.add_argument("--fps", type=float, default=_FPS, help="rate of .npy files (%(default)s)")
    options = parser.parse_args(arguments)
    if options.what == "twins" and len(options.files) % 2:
        parser.error("twins must come in pairs")
    return exit_code(lambda: _print(options))


def _print(options: argparse.Namespace) -> None:
    motions = [read_motion(file, fps=options.fps if file.endswith(".npy") else None) for file in options.files]
    made = map(trips, motions) if options.what == "trips" else map(twins, motions[::2], motions[1::2])
    for table in made:
        print(table.text())


if __name__ == "__main__":
    sys.exit(main())
