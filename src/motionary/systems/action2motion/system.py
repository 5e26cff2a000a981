"""How the models of action2motion are built, and opened for use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motionary.corpus.context import Context
from motionary.errors import InputError, configure
from motionary.systems.io import CONFIG_FILE, Trained

if TYPE_CHECKING:
    from motionary.systems.action2motion.actor import Actor
    from motionary.systems.action2motion.conditioned_vae import Action2Motion


def build_action2motion(settings: Mapping[str, Any], context: Context, trained: Trained) -> Action2Motion:
    """A fresh model; `settings` are the keys of its config, and those by which the stage chooses its variants."""
    from motionary.systems.action2motion.conditioned_vae import Action2Motion, Action2MotionConfig
    from motionary.systems.action2motion.variants import CHOICE

    own = {key: value for key, value in settings.items() if key not in CHOICE}
    return Action2Motion(configure(Action2MotionConfig, own, "action2motion"), context)


def open_actor(trained: Trained, name: str) -> Actor:
    """The trained models of every variant."""
    from motionary.systems.action2motion.actor import Actor
    from motionary.systems.action2motion.variants import order

    folder = trained.path(name)
    found = order([path.name for path in folder.glob("*") if (path / CONFIG_FILE).is_file()])
    if not found:
        raise InputError(folder, "no model", "the corpus that it was trained on names no action")
    return Actor({variant: trained.load(f"{name}/{variant}") for variant in found})
