"""What every source checks of the names and texts that it finds, so that no table fails on them at the end."""

from __future__ import annotations

import re
from pathlib import Path

from motionary.errors import InputError

_CACHED = re.compile(r"/files/md5/[0-9a-f]{2}/[0-9a-f]{30}(\.dir)?$")  # how DVC's caches name a file


def check_home(root: Path, path: Path, where: object) -> None:
    """InputError where a file is a link that leads out of the folder: a folder from elsewhere may hold such links.

    A link to a whole subfolder is allowed (its owner may keep it on another disk), and so are links to DVC's cache.
    """
    if not path.is_symlink():
        return
    home = path.resolve()
    known = any(home.is_relative_to(folder.resolve()) for folder in (root, path.parent))
    if not known and not _CACHED.search(home.as_posix()):
        raise InputError(where, path.name, "is a link that leads out of the folder")


def check_unicode(text: str, where: object) -> str:
    """The text; InputError where it holds half of a surrogate pair (a cut emoji), which no table can store."""
    if any("\ud800" <= character <= "\udfff" for character in text):
        raise InputError(where, text, "must be Unicode text; half of a character was cut off")
    return text


def unforeseen(where: object, error: Exception) -> InputError:
    """A clip's problem that no check foresaw, with its kind."""
    return InputError(where, f"{type(error).__name__}: {error}", "this clip cannot be used")
