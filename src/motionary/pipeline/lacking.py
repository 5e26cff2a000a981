"""What a corpus lacks, and which stages cannot be trained without it."""

from __future__ import annotations

import json
from pathlib import Path

from motionary.systems import registry

LANGUAGE = (
    registry.TEXT_TO_MOTION,
    registry.MOTION_TO_TEXT,
    registry.TEXT_TO_LENGTH,
    registry.EMBED,
    registry.SEARCH,
    registry.BLEND,
)
OFFERS = {  # what clips.jsonl must have: what then can be offered
    "captions": LANGUAGE,
    "style labels": (registry.STYLIZE, registry.JUDGE_STYLE),
    "action labels": (registry.ACT, registry.JUDGE_ACTION),
}


def lacking(root: Path) -> dict[str, str]:
    """{stage: what the clips of the project's corpus would need for it}; empty where there is no corpus yet."""
    corpus = root / "data" / "corpus"
    try:
        report = json.loads((corpus / "report.json").read_text(encoding="utf-8"))
        context = json.loads((corpus / "context.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    there = {
        "captions": report.get("captions", 1),
        "style labels": len(context.get("styles", ())),
        "action labels": len(context.get("actions", ())),
    }
    return {
        name: what
        for what, offers in OFFERS.items()
        if not there[what]
        for name, system in registry.known().items()
        if not set(offers).isdisjoint(system.offers)
    }


def told(lacks: dict[str, str], left: set[str]) -> str:
    """One paragraph on the stages `left` out, of which those in `lacks` want something and the others stand on them."""
    lines = []
    for what in dict.fromkeys(lacks.values()):
        names = sorted(name for name in left if lacks.get(name) == what)
        if names:
            lines.append(f"left out for want of {what} in clips.jsonl (docs/data.md): {', '.join(names)}")
    if others := sorted(left - set(lacks)):
        lines.append(f"left out with them, since they stand on them: {', '.join(others)}")
    return "\n".join(lines)
