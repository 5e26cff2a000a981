"""How the systems of latent stylization are built on what they need, and opened for use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motionary.corpus.context import Context
from motionary.errors import configure
from motionary.systems.io import Trained

if TYPE_CHECKING:
    from motionary.systems.stylization.global_motion import GlobalMotion
    from motionary.systems.stylization.latents import Latents
    from motionary.systems.stylization.style_transfer import StyleTransfer
    from motionary.systems.stylization.stylizer import Stylizer


def build_latents(settings: Mapping[str, Any], context: Context, trained: Trained) -> Latents:
    """A fresh autoencoder of motion codes; `settings` are the keys of its config."""
    from motionary.systems.stylization.latents import Latents, LatentsConfig

    return Latents(configure(LatentsConfig, settings, "latents"), context)


def build_global_motion(settings: Mapping[str, Any], context: Context, trained: Trained) -> GlobalMotion:
    """A fresh predictor of the root's velocities; `settings` are the keys of its config."""
    from motionary.systems.stylization.global_motion import GlobalMotion, GlobalMotionConfig

    return GlobalMotion(configure(GlobalMotionConfig, settings, "global_motion"), context)


def build_stylizer(settings: Mapping[str, Any], context: Context, trained: Trained) -> Stylizer:
    """A fresh stylizer on the trained latents.

    `settings` are the stage's own keys, which hold one section of loss weights for each setting, with "setting", which
    of them it is, and "window", the frames of a training window.
    """
    from motionary.systems.stylization.stylizer import SETTINGS, StylizationConfig, Stylizer

    latents, setting = trained.load("latents"), settings["setting"]
    shared = {k: v for k, v in settings.items() if k not in (*SETTINGS, "settings", "setting")}
    known = latents.config
    upstream = {"variant": known.variant, "latent_width": known.width, "code_dim": known.code_dim}
    labels = len(context.styles) if setting == "supervised" else 0
    values = {"labels": labels, **shared, **settings.get(setting, {}), **upstream}
    config = configure(StylizationConfig, values, "stylization")
    model = Stylizer(config, context)
    model.latents.load_state_dict(latents.state_dict())
    return model


def open_stylizer(trained: Trained, name: str) -> StyleTransfer:
    """The trained stylizers of every setting, with the predictor of the root's velocities."""
    from motionary.systems.stylization.style_transfer import StyleTransfer
    from motionary.systems.stylization.stylizer import SETTINGS

    found = {s: trained.load(f"{name}/{s}") for s in SETTINGS if trained.path(f"{name}/{s}").is_dir()}
    return StyleTransfer(found, trained.load("global_motion"))
