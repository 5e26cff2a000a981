"""From folders of captioned motion to a memory-mapped corpus and its batches (`corpus.preprocess.preprocess`)."""

from __future__ import annotations

import importlib

_WHERE = {
    "Context": "context",
    "Corpus": "store",
    "Batch": "batches",
    "Batches": "batches",
    "Pairs": "batches",
    "TokenStore": "batches",
    "Windows": "batches",
    "Caption": "clips",
    "Clip": "clips",
    "DataConfig": "config",
    "inventory": "sources",
    "open_sources": "sources",
}
__all__ = sorted(_WHERE)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str):
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_WHERE[name]}", __name__), name)
