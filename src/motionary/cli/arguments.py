"""The options of every command, with examples in ``--help``."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import Any, NoReturn


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line and exit code 2."""
        self.exit(2, f"error: {message}; see `{self.prog} --help`\n")


def build_parser(commands: Mapping[str, Callable[[argparse.Namespace], Any]]) -> argparse.ArgumentParser:
    """The parser of all commands; the parsed options carry the function to call as `run`."""
    from motionary import __version__

    parser = _Parser("motionary", description="A two-way dictionary between human motion and language.")
    parser.add_argument("--version", action="version", version=__version__)
    group = parser.add_subparsers(metavar="command", required=True)
    for name, (line, arguments, examples) in _COMMANDS.items():
        command = group.add_parser(
            name,
            help=line,
            description=line,
            epilog="examples:\n" + "\n".join(f"  {example}" for example in examples),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.set_defaults(run=commands[name])
        arguments(command)
    return parser


def _generate_arguments(add: argparse.ArgumentParser) -> None:
    _prompt_arguments(add)
    add.add_argument("-n", type=_count, default=1, help="motions for each prompt (1)")
    add.add_argument("--seconds", type=float, help="length; the system decides where not given")
    add.add_argument("--system", help="which system answers (the usual one)")
    add.add_argument("--out", default=".", metavar="FOLDER", help="where the files go (here)")
    add.add_argument("--format", default="bvh", metavar="A,B", help="bvh, npz, npy, glb, mp4, gif, html (bvh)")
    add.add_argument("--force", action="store_true", help="replace existing files")
    add.add_argument("--temperature", type=float, help="of sampling")
    add.add_argument("--top-p", type=float, help="of sampling")
    add.add_argument("--style", metavar="NAME", help="stylize the result")
    _model_arguments(add)


def _caption_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("files", nargs="+", metavar="FILE", help="bvh, amc, npz or npy")
    add.add_argument("-n", type=_count, default=1, help="captions of each, best first (1)")
    add.add_argument("--beams", type=_count, default=2, help="of the search (2)")
    add.add_argument("--temperature", type=float, help="draw captions at this temperature, not the likeliest")
    add.add_argument(
        "--consensus", type=_count, default=0, help="choose those that agree best with this many draws (slower)"
    )
    add.add_argument("--system", help="which system answers (the usual one)")
    add.add_argument("--fps", type=float, help="rate of files that do not say it (npy)")
    _rig_arguments(add)
    _cut_arguments(add)
    _model_arguments(add)


def _stylize_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("files", nargs="+", metavar="FILE", help="bvh, amc, npz or npy, of any length")
    add.add_argument("--style", metavar="NAME", help="of the training clips; with neither style nor reference: random")
    add.add_argument("--reference", metavar="FILE", help="a motion in the wanted style, of a second or two at least")
    add.add_argument("--strength", type=float, default=1.0, help="0 keeps the motion, 1 is the whole style (1)")
    add.add_argument("-n", type=_count, default=1, help="variants of each; a reference has only one (1)")
    add.add_argument("--out", default=".", metavar="FOLDER", help="where the files go (here)")
    add.add_argument("--format", default="bvh", metavar="A,B", help="bvh, npz, npy, glb, mp4, gif, html (bvh)")
    add.add_argument("--force", action="store_true", help="replace existing files")
    add.add_argument("--fps", type=float, help="rate of files that do not say it (npy)")
    _rig_arguments(add)
    _cut_arguments(add)
    _model_arguments(add)


def _search_arguments(add: argparse.ArgumentParser) -> None:
    _prompt_arguments(add)
    add.add_argument("-k", type=_count, default=5, help="matches for each prompt (5)")
    _model_arguments(add)


def _convert_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("source", metavar="IN", help="bvh, amc, npz or npy")
    add.add_argument("target", metavar="OUT", help="bvh, npz, npy, glb, mp4, gif or html")
    add.add_argument("--fps", type=float, help="rate of the result")
    add.add_argument("--source-fps", type=float, help="rate of a file that does not say it (npy)")
    add.add_argument("--skeleton", help="retarget to smpl22 or kit21")
    add.add_argument("--caption", help="shown in mp4, gif and html")
    add.add_argument("--force", action="store_true", help="replace an existing file")
    _rig_arguments(add)
    _cut_arguments(add)


def _view_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("files", nargs="+", metavar="FILE", help="bvh, amc, npz or npy, shown side by side")
    add.add_argument("--out", metavar="PAGE.html", help="keep the page here (a temporary folder)")
    add.add_argument("--fps", type=float, help="rate of files that do not say it (npy)")
    add.add_argument("--force", action="store_true", help="replace an existing page")
    add.add_argument("--no-open", action="store_true", help="write the page, open no browser")


def _app_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("--host", default="127.0.0.1", help="address to listen on; 0.0.0.0 is everyone's (%(default)s)")
    add.add_argument("--port", type=int, default=8080, help="0 takes any that is free (%(default)s)")
    told = "another site whose pages may connect, such as a proxy's that renames the host; repeat it for several"
    add.add_argument("--origin", action="append", default=[], metavar="URL", help=told)
    add.add_argument("--models", default="models", metavar="FOLDER", help="what `dvc repro` built (models)")
    add.add_argument("--device", default="auto", help="auto, cpu or cuda")


def _prompt_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("prompts", nargs="*", metavar="PROMPT", help="what to look for; - reads standard input")
    add.add_argument("--file", metavar="FILE", help="prompts from a text file, one a line")


def _rig_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument(
        "--mapping", metavar="FILE", help="JSON with the joint's name by role, for a rig that is not known"
    )


def _cut_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("--start", type=float, help="seconds from which the motion counts")
    add.add_argument("--end", type=float, help="seconds up to which it counts")


def _model_arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("--seed", type=int, default=0, help="equal seeds repeat on one machine (0)")
    add.add_argument("--models", default="models", metavar="FOLDER", help="what `dvc repro` built (models)")
    add.add_argument("--device", default="auto", help="auto, cpu or cuda")
    add.add_argument("--json", action="store_true", help="print JSON")


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value}: must be at least 1")
    return value


_count.__name__ = "whole number"  # argparse names the type in its messages

_COMMANDS: dict[str, tuple[str, Callable[[argparse.ArgumentParser], None], tuple[str, ...]]] = {
    "generate": (
        "Make motions from text.",
        _generate_arguments,
        (
            'motionary generate "a person waves with the left hand" -n 3 --seed 0 --out out --format bvh,glb,mp4',
            "motionary generate --file prompts.txt --seconds 4 --json",
            'echo "a person jumps" | motionary generate',
            'motionary generate "a person walks" --style old',
        ),
    ),
    "caption": (
        "Describe motions in words.",
        _caption_arguments,
        ("motionary caption walk.bvh", "motionary caption a.bvh b.npz -n 3 --json"),
    ),
    "stylize": (
        "Give motions another style.",
        _stylize_arguments,
        (
            "motionary stylize walk.bvh --style old --out out --format bvh,glb",
            "motionary stylize walk.bvh --reference limp.bvh",
            "motionary stylize walk.bvh -n 3 --seed 1",
        ),
    ),
    "search": (
        "Find motions of the corpus by text.",
        _search_arguments,
        ('motionary search "a person sits down"', "motionary search --file prompts.txt -k 3"),
    ),
    "convert": (
        "Turn a motion file into another format.",
        _convert_arguments,
        ("motionary convert in.bvh out.glb --fps 30", 'motionary convert walk.npz walk.mp4 --caption "a walk"'),
    ),
    "view": (
        "Play motions in a browser.",
        _view_arguments,
        ("motionary view motion.npz", "motionary view a.bvh b.bvh --out pair.html --no-open"),
    ),
    "app": (
        "The dictionary in a browser.",
        _app_arguments,
        ("motionary app", "motionary app --port 9000 --models models"),
    ),
}
