"""``motionary act``: motions of action labels."""

from __future__ import annotations

import argparse
from typing import Any

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.outputs import Outputs, add_outputs, slug, variants


def _arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("actions", nargs="+", metavar="ACTION", help="of the training clips; several follow each other")
    add.add_argument("-n", type=shared.count, default=1, help="variants (1)")
    add.add_argument("--seconds", type=float, nargs="+", default=[3.0], help="how long: one, or one an action (3)")
    add.add_argument("--scale", type=float, default=1.0, help="of the body (1)")
    add.add_argument("--start", metavar="FILE", help="a motion that is gone on from")
    add.add_argument("--source-fps", type=float, help="rate of the start, whatever it says (npy says none)")
    told = "motions between the first poses of two seeds, in place of -n and --seed: as many as --steps"
    add.add_argument("--between", type=int, nargs=2, metavar="SEED", help=told)
    add.add_argument("--steps", type=shared.count, help="for --between (5)")
    shared.add_feet(add)
    add_outputs(add)
    shared.add_reading(add)
    shared.add_seed(add)
    shared.add_models(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """Motions of actions, in every format asked for."""
    from motionary.errors import InputError
    from motionary.formats import read_motion

    if options.steps is not None and options.between is None:
        raise InputError("--steps", options.steps, "is the number of motions of --between")
    steps = 5 if options.steps is None else options.steps
    count = options.n if options.between is None else steps
    names = variants(slug("-".join(options.actions), "action"), count)
    outputs = Outputs(options)
    if options.between is not None and (len(options.actions) > 1 or options.start or len(options.seconds) > 1):
        raise InputError("--between", " ".join(options.actions), "takes one action, one length and no start")
    start = None
    if options.start is not None:
        start = read_motion(options.start, fps=options.source_fps, **shared.reading(options))
    seconds = options.seconds if len(options.seconds) > 1 else options.seconds[0]
    dictionary = shared.open_models(options)
    if options.between is not None:
        seeds = (options.between[0], options.between[1])
        made = dictionary.between_actions(options.actions[0], steps, seconds, seeds, options.scale, options.feet)
    else:
        made = dictionary.act(options.actions, options.n, seconds, options.seed, options.scale, start, options.feet)
    outputs.claim(names)
    rows: list[dict[str, Any]] = []
    for variant, (name, motion) in enumerate(zip(names, made, strict=True)):
        files = outputs.write(motion, name, ", ".join(options.actions))
        what = {"actions": options.actions, "seed": options.seed, "variant": variant}
        rows.append(what | {"seconds": round(motion.duration, 3), "files": files})
    shared.show(options, rows, [file for row in rows for file in row["files"]])


COMMAND = Command(
    "act",
    "Make motions of action labels.",
    _arguments,
    _run,
    (
        "motionary act walk -n 3 --out out",
        "motionary act sit wave --seconds 2 3 --format bvh,glb",
        "motionary act walk --start walk.bvh --scale 1.2",
        "motionary act kick --between 0 7 --steps 5",
    ),
)
