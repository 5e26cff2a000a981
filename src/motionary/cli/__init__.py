"""The dictionary in a shell."""

from motionary.cli.commands import main

__all__ = ["main"]
