"""What a command of the shell is, and the parser that is made of several."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from motionary.errors import shortened


@dataclass(frozen=True)
class Command:
    """One command, all of it.

    Attributes:
        name: as typed after ``motionary``.
        line: what it does, in a line.
        arguments: adds its options to a parser.
        run: does it, given the parsed options. Results go to standard output, and nothing else does.
        examples: whole lines that its ``--help`` shows.
    """

    name: str
    line: str
    arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], Any]
    examples: tuple[str, ...]


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line and exit code 2."""
        message = shortened(message, 1000)
        self.exit(2, f"error: {message}; see `{self.prog} --help`\n")


def build_parser(commands: Sequence[Command]) -> argparse.ArgumentParser:
    """The parser of these commands; the parsed options carry the function to call as `run`."""
    from motionary import __version__

    first = [command.examples[0] for command in commands]
    parser = _Parser(
        "motionary",
        description="A two-way dictionary between human motion and language.",
        epilog=_shown([*first, "motionary generate --help"]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=__version__)
    group = parser.add_subparsers(metavar="command", required=True)
    for command in commands:
        own = group.add_parser(
            command.name,
            help=command.line,
            description=command.line,
            epilog=_shown(command.examples),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        own.set_defaults(run=command.run, failed=False)
        command.arguments(own)
    return parser


def _shown(examples: Sequence[str]) -> str:
    return "examples:\n" + "\n".join(f"  {example}" for example in examples)
