"""The resolver ``${motionary.opened:...}`` of conf/: the models on which dvc.yaml lets the evaluation of a system hang.

DVC's templates have no lists of dependencies, so that every system gets as many models.
"""

from __future__ import annotations

from typing import Any

from omegaconf import DictConfig, OmegaConf

from motionary.errors import InputError
from motionary.systems.serving import served_by

MODELS = 3  # as many as dvc.yaml names


def models_opened(systems: Any, *, _root_: Any) -> Any:
    """{system: [model, ...]}: the models that each system opens when it answers, its own last and repeated to MODELS.

    Args:
        systems: names; what is none is left to whoever reads the value.
        _root_: the configuration, which says what system fills a role.

    Raises:
        InputError: a system that opens more models.
    """

    def section(name: str) -> Any:
        """The configuration of a system."""
        return _root_.get(name) or {}

    found = {}
    for name in systems if OmegaConf.is_list(systems) else []:
        try:
            opened = list(served_by([name], section))
        except InputError:
            opened = [name]
        if len(opened) > MODELS:
            raise InputError(name, opened, f"opens more than the {MODELS} models that dvc.yaml has room for")
        found[name] = opened + [name] * (MODELS - len(opened))
    return DictConfig(found)


OmegaConf.register_new_resolver("motionary.opened", models_opened, replace=True)
