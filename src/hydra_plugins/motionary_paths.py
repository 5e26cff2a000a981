"""The resolver ``${motionary.paths:...}`` of conf/: Hydra imports every module here, in DVC's process too."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf


def paths_for_copies(paths: Any, folder: Path | None = None) -> Any:
    """Paths that mean the same in every copy of the project: those that leave it become absolute, others stay.

    DVC composes the configuration in the project, but runs queued experiments in temporary copies elsewhere.

    Args:
        paths: list of paths, relative ones from the project; anything else is left to whoever reads the value.
        folder: where the project is looked for, upwards to a dvc.yaml; the working directory by default.
    """
    if not isinstance(paths, list) or not all(isinstance(path, str) for path in paths):
        return paths
    folder = folder or Path.cwd()
    project = next((f for f in (folder, *folder.parents) if (f / "dvc.yaml").is_file()), folder)
    return [_for_copies(path, project) for path in paths]


def _for_copies(path: str, project: Path) -> str:
    full = Path(os.path.abspath(project / path))
    return path if full.is_relative_to(project) else str(full)


def _resolve(paths: Any) -> Any:
    if not OmegaConf.is_list(paths):
        return paths
    return OmegaConf.create(paths_for_copies(OmegaConf.to_container(paths)))


OmegaConf.register_new_resolver("motionary.paths", _resolve, replace=True)
