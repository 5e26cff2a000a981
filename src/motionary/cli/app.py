"""``motionary app``: the dictionary in a browser."""

from __future__ import annotations

import argparse

from motionary.cli import options as shared
from motionary.cli.command import Command
from motionary.errors import InputError


def _arguments(add: argparse.ArgumentParser) -> None:
    add.add_argument("--host", default="127.0.0.1", help="address to listen on; 0.0.0.0 is everyone's (%(default)s)")
    add.add_argument("--port", type=int, default=8080, help="0 takes any that is free (%(default)s)")
    told = "another site whose pages may connect, such as a proxy's that renames the host; repeat it for several"
    add.add_argument("--origin", action="append", default=[], metavar="URL", help=told)
    shared.add_models(add)


def _run(options: argparse.Namespace) -> None:
    """Serves the page until interrupted."""
    try:
        from motionary.app.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "viser":
            raise
        raise InputError("viser", "not installed", 'the page needs it: pip install "motionary[app]"') from None
    serve(options.models, options.device, options.host, options.port, options.origin)


COMMAND = Command(
    "app",
    "The dictionary in a browser.",
    _arguments,
    _run,
    ("motionary app", "motionary app --port 9000 --models models"),
)
