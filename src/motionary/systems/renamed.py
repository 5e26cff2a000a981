"""Configuration keys that once had another name, so that saved models load and old overrides are answered."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from typing import Any

from motionary.errors import InputError

_TRAINING = {"clip": "max_grad_norm", "warmup": "warmup_steps", "ema": "ema_decay"}
_TRANSFORMER = {"layers": "num_layers", "heads": "num_heads", "feed_forward": "dim_feedforward"}
_CODES = {"sparsity": "sparsity_weight", "smoothness": "smoothness_weight"}
_TOKENS = {"codes": "codebook_size", "most_tokens": "max_tokens", **_TRANSFORMER}
_MODELS: Mapping[str, Mapping[str, str]] = {
    "autoencoder": {"square_from": "berhu_threshold", **_CODES},
    "tokenizer": {
        "codes": "codebook_size",
        "beta": "commitment_weight",
        "decay": "codebook_decay",
        "dead": "restart_below",
        "warm_start": "codebook_start",
        "square_from": "berhu_threshold",
        "freeze_from": "freeze_encoder_from",
    },
    "motion2text": {
        "codes": "codebook_size",
        "members": "ensemble",
        "shifts": "offsets",
        "most_words": "max_words",
        **_TRANSFORMER,
    },
    "text2token": _TOKENS,
    "inverse_alignment": _TOKENS,
    "text2length": {"spread": "target_std"},
    "latents": {"kl": "kl_weight", **_CODES},
    "stylization": {"blocks": "num_blocks"},
}


def new_name(section: str, key: str) -> str | None:
    """What a key of a section of the configuration is called now; None where it has no other name."""
    return {**_TRAINING, **_MODELS.get(section, {})}.get(key)


def refuse_old_names(section: str, keys: Iterable[str]) -> None:
    """InputError where a key of a section of the configuration has another name now."""
    for key in keys:
        if (now := new_name(section, key)) is not None:
            raise InputError(f"{section}.{key}", "renamed", f"is called {section}.{now} now")


def answer_old_overrides(arguments: Iterable[str]) -> None:
    """Ends the program with one line and exit code 2 where an override uses an old name: Hydra would only say that it
    does not know it."""
    for argument in arguments:
        section, _, key = argument.lstrip("+~").split("=", 1)[0].partition(".")
        try:
            refuse_old_names(section, [key])
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            sys.exit(2)


def with_new_names(system: str, config: Mapping[str, Any]) -> dict[str, Any]:
    """The saved configuration of a model with the present names of its keys."""
    names = _MODELS.get(system, {})
    return {names.get(key, key): value for key, value in config.items()}
