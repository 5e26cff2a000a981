"""``motionary generate``: motions from text."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.cli.constraints import add_constraints, lengths, read_keyframes
from motionary.cli.outputs import Outputs, add_outputs, slug, variants
from motionary.errors import InputError

if TYPE_CHECKING:
    from motionary.dictionary import Dictionary
    from motionary.motion import Motion

CHUNK = 128  # motions generated and written before the next are begun, so that memory does not grow with the prompts


def _arguments(add: argparse.ArgumentParser) -> None:
    shared.add_prompts(add)
    add.add_argument("-n", type=shared.count, default=1, help="motions to generate for each prompt (1)")
    add.add_argument("--seconds", type=lengths, metavar="A,B", help="length, or one a prompt; else the system decides")
    add_constraints(add)
    shared.add_system(add)
    add_outputs(add)
    add.add_argument("--temperature", type=shared.above_zero, help="above 1 generates more variety, below 1 less")
    told = "draw from the likeliest tokens that have this share together, of systems that write tokens"
    add.add_argument("--top-p", type=shared.share, help=told)
    add.add_argument("--top-k", type=shared.count, help="draw from so many of the likeliest tokens, of such systems")
    told = "how closely the text is kept, of systems that were trained for it; 1 is off"
    add.add_argument("--guidance", type=float, help=told)
    add.add_argument("--greedy", action="store_true", default=None, help="the likeliest motion in place of a draw")
    shared.add_feet(add)
    add.add_argument("--style", metavar="NAME", help="give what was generated a style of the training clips")
    shared.add_seed(add)
    shared.add_models(add)
    shared.add_json(add)


def _run(options: argparse.Namespace) -> None:
    """Motions for prompts, each in every format asked for."""
    from tqdm import tqdm

    prompts = shared.read_prompts(options)
    keyframes = read_keyframes(options)
    names = _names(["-".join(prompts)] if options.join else prompts, options.n)
    outputs = Outputs(options)
    dictionary = shared.open_models(options)
    _check(dictionary, prompts, options, keyframes)
    outputs.claim(name for row in names for name in row)
    rows: list[dict[str, Any]] = []
    total = len(names) * options.n
    with tqdm(total=total, unit="motion", desc="generate", disable=total < 4) as bar:
        made = _generated(dictionary, prompts, options, keyframes)
        told = [", then ".join(prompts)] if options.join else prompts
        for text, row, motions in zip(told, names, made, strict=True):
            if not options.join:
                _say_parts(text)
            what = {"text": text, **shared.say_reading(dictionary, text), "seed": options.seed}
            for variant, (name, motion) in enumerate(zip(row, motions, strict=True)):
                seconds, files = round(motion.duration, 3), outputs.write(motion, name, text)
                rows.append(what | {"variant": variant, "seconds": seconds, "files": files})
                bar.update()
    shared.show(options, rows, [file for row in rows for file in row["files"]])


def _say_parts(text: str) -> None:
    """One line on standard error where a prompt tells of several motions, of which a system may make only one."""
    from motionary.language import prompt_parts

    if len(parts := prompt_parts(text)) > 1:
        given = " ".join(f'"{part}"' for part in parts)
        print(f"note: a part may be lost; several prompts make one motion of all: {given} --join", file=sys.stderr)


def _check(
    dictionary: Dictionary, prompts: Sequence[str], options: argparse.Namespace, keyframes: Mapping[float, Motion]
) -> None:
    """InputError for what is wrong with the options, before it is said which files are there."""
    from motionary.corpus.encoding import frames_of
    from motionary.dictionary.control import check_one
    from motionary.dictionary.generating import each_length
    from motionary.systems.registry import TEXT_TO_MOTION

    if options.style is not None and (options.loop or options.path or keyframes):
        raise InputError("--style", options.style, "makes a way of its own: not with --loop, --path or --keyframe")
    check_one(options.loop, options.path, keyframes or None, options.join, len(prompts))
    context = dictionary.opened(TEXT_TO_MOTION, options.system).context
    for seconds in each_length(_seconds(options), len(prompts)) or ():
        frames_of(seconds, context)
    shared.check_style(dictionary, options)


def _seconds(options: argparse.Namespace) -> float | list[float] | None:
    """--seconds: one length, or one for each prompt."""
    return options.seconds[0] if options.seconds and len(options.seconds) == 1 else options.seconds


def _generated(
    dictionary: Dictionary, prompts: Sequence[str], options: argparse.Namespace, keyframes: Mapping[float, Motion]
) -> Iterator[list[Motion]]:
    """The variants of each prompt, in the style asked for; a chunk of prompts is generated together."""
    from motionary.systems.protocols import SAMPLING

    chosen = {key: value for key in SAMPLING if (value := getattr(options, key)) is not None}
    seconds = _seconds(options)
    constraints = {"join": options.join, "loop": options.loop, "path": options.path, "keyframes": keyframes or None}
    asked = (options.system, options.seed, options.feet)
    # Lengths one a prompt, and prompts that become one motion, belong together.
    whole = options.join or isinstance(seconds, list)
    chunk = len(prompts) if whole else max(1, CHUNK // options.n)
    for first in range(0, len(prompts), chunk):
        part = prompts[first : first + chunk]
        made = dictionary.generate(part, options.n, seconds, *asked, **constraints, **chosen)
        for motions in [made] if options.join else made:
            yield motions if options.style is None else _restyled(dictionary, motions, options)


def _restyled(dictionary: Dictionary, motions: Sequence[Motion], options: argparse.Namespace) -> list[Motion]:
    """Generated motions in the style asked for, each variant with a draw of its own."""
    seed, feet = options.seed, options.feet
    draws = (dictionary.stylize(m, options.style, seed=seed + k, feet=feet) for k, m in enumerate(motions))
    return [motion for (motion,) in draws]


def _names(prompts: Sequence[str], n: int) -> list[list[str]]:
    """Names of the files of each prompt, without extension: numbered where there are several."""
    width, names = len(str(len(prompts) - 1)), []
    for i, text in enumerate(prompts):
        name = slug(text, "motion")
        names.append(variants(name if len(prompts) == 1 else f"{i:0{width}d}-{name}", n))
    return names


COMMAND = Command(
    "generate",
    "Make motions from text.",
    _arguments,
    _run,
    (
        'motionary generate "a person waves with the left hand" -n 3 --seed 0 --out out --format bvh,glb,mp4',
        "motionary generate --file prompts.txt --seconds 4 --json",
        'echo "a person jumps" | motionary generate',
        'motionary generate "a person walks" --style old',
        'motionary generate "a person walks" "a person sits down" --seconds 3,2 --join',
        'motionary generate "a person walks" --path "0,0 0,2 2,3" --out out',
        'motionary generate "a person waves" --seconds 3 --loop',
        'motionary generate "a person walks" --seconds 3 --keyframe 0=walk.bvh --keyframe 1.5=walk.bvh@1.5',
    ),
)
