"""Texts as the page shows them."""

from __future__ import annotations

import re
from collections.abc import Sequence

_LONGEST = 44  # letters of a lone title
_NARROW = 20  # letters of a line above figures that stand side by side


def plain(text: str) -> str:
    """Text that markdown shows as it is: the page runs what stands in HTML tags."""
    escaped = re.sub(r"([\\`*_{}\[\]<>()#+!|~&$-])", r"\\\1", " ".join(text.split()))
    return re.sub(r"^(\d+)\.", r"\1\\.", escaped)  # no list


def short(text: str, most: int = _LONGEST) -> str:
    """The beginning of a text of more than `most` letters."""
    return text if len(text) <= most else text[: most - 3] + "..."


def titles(texts: Sequence[str]) -> list[str]:
    """Titles of figures: numbered where there are several, and given only once where all are the same."""
    if len(texts) == 1:
        return [short(texts[0])]
    if len(set(texts)) == 1:
        return [str(k + 1) for k in range(len(texts))]
    return [f"{k + 1}. {short(text, _NARROW)}" for k, text in enumerate(texts)]


def listed(texts: Sequence[str]) -> str:
    """Markdown of a list."""
    return "\n".join(f"- {plain(text)}" for text in texts)


def file_name(text: str) -> str:
    """Letters and digits of a text, for a file without its extension."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")[:60] or "motion"
