"""The resolver ``${motionary.paths:...}`` of conf/: Hydra imports every module here, in DVC's process too."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from omegaconf import ListConfig, OmegaConf


def paths_for_copies(paths: Any) -> Any:
    """Paths that mean the same in every copy of the project: those that leave it become absolute, others stay.

    DVC composes the configuration in the project (the nearest folder upwards with a dvc.yaml), but runs queued
    experiments in temporary copies elsewhere.

    Args:
        paths: list of paths, relative ones from the project; anything else is left to whoever reads the value.
    """
    if not OmegaConf.is_list(paths) or not all(isinstance(path, str) for path in paths):
        return paths
    here = Path.cwd()
    project = next((folder for folder in (here, *here.parents) if (folder / "dvc.yaml").is_file()), here)
    full = [Path(os.path.abspath(project / path)) for path in paths]
    return ListConfig([p if f.is_relative_to(project) else str(f) for p, f in zip(paths, full, strict=True)])


OmegaConf.register_new_resolver("motionary.paths", paths_for_copies, replace=True)
