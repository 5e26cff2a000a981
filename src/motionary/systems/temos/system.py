"""How TEMOS is built and opened for use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motionary.corpus.context import Context
from motionary.errors import configure
from motionary.systems.io import Trained, lengths_of, model_hash
from motionary.whole import check_output

if TYPE_CHECKING:
    from motionary.systems.temos.joint_space import JointSearch, JointSpace
    from motionary.systems.temos.temos import Temos
    from motionary.systems.temos.temos_generator import TemosGenerator


def build_temos(settings: Mapping[str, Any], context: Context, trained: Trained) -> Temos:
    """A fresh model for the states of its language model; `settings` are the keys of its config."""
    from motionary.language.frozen import state_dim
    from motionary.systems.temos.temos import Temos, TemosConfig

    config = configure(TemosConfig, settings, "temos")
    dim = state_dim(config.language_model or None)
    return Temos(configure(TemosConfig, {**settings, "text_dim": dim}, "temos"), context)


def open_generator(trained: Trained, name: str) -> TemosGenerator:
    """The generator of motions, with text2length for durations that are not given."""
    from motionary.systems.temos.temos_generator import TemosGenerator

    return TemosGenerator(trained.load(name), lengths_of(trained))


def open_joint_space(trained: Trained, name: str) -> JointSpace:
    """Texts and motions in the joint space."""
    from motionary.systems.temos.joint_space import JointSpace

    return JointSpace(trained.load(name), model_hash(trained.path(name)))


def open_joint_search(trained: Trained, name: str) -> JointSearch:
    """Search of the corpus beside the folder of models."""
    from motionary.systems.temos.joint_space import JointSearch, LatentIndex

    run, own = trained.folder.parent, trained.path(name)
    index = LatentIndex.load(check_output(run, f"{trained.folder.name}/{own.name}"), name)
    return JointSearch(check_output(run, "data/corpus"), open_joint_space(trained, name), index)
