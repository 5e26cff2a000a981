"""The models that one training makes: a decoder on coarse labels ("glmi_m"), or on fine ones ("glmi_m_fine")."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motionary.errors import InputError
from motionary.systems.action2motion.pose_decoders import DECODERS

BASELINE = "cond_gru"  # CondGRU, the deterministic baseline of 3.3: no latent, joints straight from the state
CHOICE = ("variants", "fine_variants")  # keys of the stage's section that name them
_FINE = "_fine"
_USUAL = ("glmi_m", "glmi_r", "lie", "plain", BASELINE)


def variants_of(coarse: Sequence[str], fine: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Settings of each variant by its name.

    Args:
        coarse: decoders, and the baseline, that are trained on coarse labels.
        fine: those on fine labels.

    Raises:
        InputError: an unknown name, or none at all.
    """
    found: dict[str, dict[str, Any]] = {}
    for key, names, end in zip(CHOICE, (coarse, fine), ("", _FINE), strict=True):
        if not isinstance(names, list | tuple):
            raise InputError(f"action2motion.{key}", names, "must be a list")
        for name in names:
            if name not in _USUAL:
                raise InputError(f"action2motion.{key}", name, f"must be among {', '.join((*DECODERS, BASELINE))}")
            own = {"decoder": "plain", "baseline": True} if name == BASELINE else {"decoder": name}
            found[name + end] = {**own, "fine": bool(end)}
    if not found:
        raise InputError("action2motion.variants", "none", "must name at least one")
    return found


def order(names: Sequence[str]) -> list[str]:
    """Names of variants, the usual one first: coarse before fine, GLMI-M first (thesis: "produces the best")."""
    known = [name + end for end in ("", _FINE) for name in _USUAL]
    return sorted(names, key=lambda name: known.index(name) if name in known else len(known))
