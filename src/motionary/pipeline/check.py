"""Every section of the configuration, checked before anything runs: ``python -m motionary.pipeline.check``.

A stage checks its own section when it starts, which may be after an hour of others. What depends on the corpus, such
as a pool larger than its test split, only the stage can know.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from motionary.errors import MOST, WIDEST, InputError, check_whole, configure, exit_code
from motionary.systems.registry import find, known
from motionary.systems.renamed import refuse_old_names
from motionary.training.settings import SEED_KEY, check_data, check_precision, model_keys, settings_of

Values = Mapping[str, Any]
DEVICES = ("auto", "cpu", "cuda", "mps")
VECTORS = ("auto", "language_model", "learned")  # or a file


def check_params(root: Path) -> None:
    """Raises InputError for the first wrong value of ``params.yaml`` in `root`; without that file there is nothing."""
    from omegaconf import OmegaConf  # which reads numbers as the stages do

    if not (root / "params.yaml").is_file():
        return
    values = OmegaConf.to_container(OmegaConf.load(root / "params.yaml"))
    check(values if isinstance(values, dict) else {}, root)  # type: ignore[arg-type]


def check(values: Values, root: Path) -> None:
    """Raises InputError, ``section.key: value: rule``, for the first wrong value of a composed configuration."""
    for section, own in values.items():
        if section in SECTIONS or section in known():
            if not isinstance(own, Mapping):
                raise InputError(section, own, "must be a section of keys and values")
            SECTIONS.get(section, check_system)(section, own, values, root)
    _check_shared(values)


def _check_shared(values: Values) -> None:
    for key in ("scale", "device"):
        _check_text(key, values.get(key, "auto"))
    for key, least in (("seed", 0), ("threads", 0)):
        if key in values:
            check_whole(key, values[key], least)
    if values.get("threads", 0) > 4096:
        raise InputError("threads", values["threads"], "must be at most 4096")
    if (device := values.get("device", "auto")) not in DEVICES:
        raise InputError("device", device, f"must be one of {', '.join(DEVICES)}")
    check_precision(values.get("precision", "auto"))


def check_system(name: str, own: Values, values: Values, root: Path) -> None:
    """A system's section: its training, how its data is drawn, its network with what other systems decide of it."""
    refuse_old_names(name, own)
    if SEED_KEY in own:
        check_whole(f"{name}.{SEED_KEY}", own[SEED_KEY], 0)
    for role in find(name).needs:
        if role in own:
            _check_known(f"{name}.{role}", own[role])
    if "steps" in own:
        settings_of(own, name)
    check_data(own, name)
    _check_model(f"{name}.language_model", own.get("language_model", ""))
    if not find(name).config:
        _check_count(f"{name}.batch_size", own.get("batch_size", 1), WIDEST)
    elif "settings" in own:
        _check_variants(name, own, values)
    else:
        _configure(name, model_keys(own), values)


def _configure(name: str, own: Values, values: Values) -> None:
    """Builds a system's config dataclass; keys that it lacks come from the systems that it needs, where known."""
    kind = find(name).load(find(name).config)
    missing = {field.name for field in fields(kind)} - own.keys()
    upstream: dict[str, Any] = {}
    for role in find(name).needs:
        section = values.get(own.get(role, role)) or {}
        upstream = {key: value for key, value in section.items() if key in missing} | upstream
    configure(kind, {**upstream, **own}, name)


def _check_variants(name: str, own: Values, values: Values) -> None:
    """Checks a section that trains one model for each name in its `settings`; each of these has its own section."""
    of_each = {key: value for key, value in own.items() if isinstance(value, Mapping)}
    for field in fields(find(name).load(find(name).config)):
        if field.name in of_each:
            raise InputError(f"{name}.{field.name}", of_each[field.name], "must be a value, not a section")
    settings = own["settings"]
    if not isinstance(settings, list) or not settings or not set(settings) <= of_each.keys():
        raise InputError(f"{name}.settings", settings, f"must be a list of some of {', '.join(of_each)}")
    shared = {key: value for key, value in model_keys(own).items() if key not in of_each and key != "settings"}
    for setting, values_of in of_each.items():
        try:
            _configure(name, {**shared, **values_of}, values)
        except InputError as error:
            key = error.what.removeprefix(f"{name}.")
            where = f"{name}.{setting}.{key}" if key in values_of else error.what
            raise InputError(where, error.value, error.rule) from None


def _check_model(key: str, model: Any) -> None:
    """A frozen language model, "" for the packaged one, must be stored here before the stage that reads it."""
    _check_text(key, model)
    if model:
        from motionary.language.frozen import state_dim

        try:
            state_dim(model)
        except InputError as error:
            raise InputError(key, model, error.rule) from None


def _check_known(key: str, system: Any) -> None:
    if not isinstance(system, str) or system not in known():
        raise InputError(key, system, f"must be one of {', '.join(known())}")


def _check_count(key: str, value: Any, most: int) -> None:
    check_whole(key, value, 1)
    if value > most:
        raise InputError(key, value, f"must be at most {most}")


def _check_data(name: str, own: Values, values: Values, root: Path) -> None:
    from motionary.corpus.config import DataConfig
    from motionary.features import CODECS
    from motionary.motion import Skeleton

    config = DataConfig.from_mapping(own)
    if config.codec not in CODECS:
        raise InputError("data.codec", config.codec, f"must be one of {', '.join(CODECS)}")
    try:
        Skeleton.named(config.skeleton)
    except InputError as error:
        raise InputError("data.skeleton", config.skeleton, error.rule) from None
    # In the copy of the project that a queued experiment runs in, folders outside it are found by their absolute paths.
    absolute = values.get("source", {}).get("roots") or []
    for number, folder in enumerate(config.roots):
        if not any((root / place).is_dir() for place in (folder, *absolute[number : number + 1])):
            raise InputError("data.roots", folder, "no such folder")


def _check_source(name: str, own: Values, values: Values, root: Path) -> None:
    roots = own.get("roots", [])
    if not isinstance(roots, list) or not all(isinstance(folder, str) for folder in roots):
        raise InputError("source.roots", roots, "must be a list of folders")
    _check_text("source.root", own.get("root", ""))


def _check_text(key: str, value: Any) -> None:
    if not isinstance(value, str):
        raise InputError(key, value, "must be text")


def _check_language(name: str, own: Values, values: Values, root: Path) -> None:
    vectors = own.get("word_vectors", "auto")
    if vectors not in VECTORS and not (isinstance(vectors, str) and os.path.isfile(root / vectors)):
        raise InputError("language.word_vectors", vectors, f"must be one of {', '.join(VECTORS)}, or a GloVe text file")


def _check_styles(name: str, own: Values, values: Values, root: Path) -> None:
    from motionary.corpus.cells import StyleConfig

    configure(StyleConfig, own, name)


def _check_style_evaluation(name: str, own: Values, values: Values, root: Path) -> None:
    from motionary.evaluation.style_scores import StyleProtocol

    configure(StyleProtocol, own, name)


def _check_action2motion(name: str, own: Values, values: Values, root: Path) -> None:
    from motionary.systems.action2motion.variants import CHOICE, variants_of

    check_data(own, name)
    settings_of(own, name)
    shared = {key: value for key, value in model_keys(own).items() if key not in CHOICE}
    for settings in variants_of(*(own.get(key, []) for key in CHOICE)).values():
        configure(find(name).load(find(name).config), {**shared, **settings, "labels": ["any"]}, name)


def _check_action_evaluation(name: str, own: Values, values: Values, root: Path) -> None:
    from motionary.evaluation.action_scores import ActionProtocol

    configure(ActionProtocol, own, name)


def _check_evaluation(name: str, own: Values, values: Values, root: Path) -> None:
    from motionary.evaluation.scores import Protocol

    systems = own.get("systems", [])
    if not isinstance(systems, list):
        raise InputError("evaluation.systems", systems, "must be a list of systems")
    for key, system in (*(("systems", system) for system in systems), ("system", own.get("system"))):
        _check_known(f"evaluation.{key}", system)
    configure(Protocol, {key: value for key, value in own.items() if key not in ("systems", "system")}, name)


def _check_report(name: str, own: Values, values: Values, root: Path) -> None:
    _check_count("report.examples", own.get("examples", 1), MOST)


# What is no system's section; a system's is checked by `check_system`.
SECTIONS: dict[str, Callable[[str, Values, Values, Path], None]] = {
    "data": _check_data,
    "source": _check_source,
    "language": _check_language,
    "styles": _check_styles,
    "style_evaluation": _check_style_evaluation,
    "action2motion": _check_action2motion,
    "action_evaluation": _check_action_evaluation,
    "evaluation": _check_evaluation,
    "report": _check_report,
}


def main() -> int:
    """The command line: exit code 2 and one line where a value is wrong."""
    return exit_code(lambda: check_params(Path.cwd()))


if __name__ == "__main__":
    sys.exit(main())
