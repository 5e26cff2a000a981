"""What the code of a stage is: every file of the project that the stage loads or reads, found in its imports.

The stage `code` writes it down before all others, one listing for each stage; DVC compares the listings, so that a
stage runs again exactly when code that can change its outputs has changed. A line is the hash of what counts and where
it stands, so that two listings tell what has changed. Comments, docstrings
and layout do not count.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from motionary.pipeline.imports import imported
from motionary.pipeline.workspace import content_hash
from motionary.systems.registry import System, known
from motionary.systems.serving import filled, served_by

FOLDER = ".code"
# Bookkeeping that cannot change what a stage computes. Of the registry a stage's own systems count: see `_systems`.
INFRASTRUCTURE = frozenset(
    f"src/motionary/{name}.py"
    for name in (
        "__init__",
        "errors",
        "lazy",
        "pipeline/__init__",
        "pipeline/code",
        "pipeline/delivery",
        "pipeline/imports",
        "pipeline/journal",
        "pipeline/learning_curves",
        "pipeline/leftovers",
        "pipeline/sending",
        "pipeline/short",  # a selection of what the report says: no training is worth another column
        "pipeline/stage",
        "pipeline/sweep",
        "pipeline/tracking",
        "pipeline/workspace",
        "systems/__init__",
        "systems/registry",
        "systems/serving",
        "training/__init__",
    )
)


@dataclass(frozen=True)
class Part:
    """A file, or of it the module level and what these functions reach."""

    file: Path
    functions: tuple[str, ...] | None = None

    @property
    def place(self) -> str:
        """What of the file counts, as a listing shows it."""
        return "" if self.functions is None else f":{','.join(self.functions)}"


class Code:
    """The code of the project in `root` as it is now; every file is parsed once.

    Args:
        root: folder of the project.
        params: the configuration, which says what system fills a role; None takes params.yaml.
    """

    def __init__(self, root: Path, params: Mapping[str, Any] | None = None):
        self.root, self._given = root, params
        self._trees: dict[Path, ast.Module] = {}
        self._digests: dict[Part, str] = {}
        self._imports: dict[Part, list[Part]] = {}

    def names(self) -> list[str]:
        """What there are listings of: a stage, or, where a stage scores one system after the other, it and a system."""
        stages = [file.stem for file in sorted((self.root / "stages").glob("[!_]*.py"))]
        each = {stage: [f"{stage}@{system}" for system in known()] for stage in stages if self._scores_each(stage)}
        return [name for stage in stages for name in each.get(stage, [stage])]

    def listing(self, name: str) -> str:
        """Hash and place of all code that counts for a stage (as `names` has it), a line each."""
        stage, _, system = name.partition("@")
        systems, parts = self._systems(stage, system)
        places = {f"{self._relative(part.file)}{part.place}": part for part in self.reach(parts)}
        lines = [f"{self._hash(places[place])} {place}" for place in sorted(places)]
        return "\n".join([*lines, *map(repr, systems)]) + "\n"

    def files(self, name: str) -> set[str]:
        """Paths, relative to the project, of the files and folders that a listing covers."""
        return {self._relative(part.file) for part in self.reach(self._systems(*name.partition("@")[::2])[1])}

    def reach(self, parts: Iterable[Part]) -> list[Part]:
        """These parts, every part of the project that they import, and the data of all these; no infrastructure."""
        seen: set[Part] = set()
        queue = list(parts)
        while queue:
            part = queue.pop()
            if part not in seen:
                seen.add(part)
                queue += self._reached(part)
        whole = {part.file for part in seen if part.functions is None}
        return [
            p
            for p in seen
            if self._relative(p.file) not in INFRASTRUCTURE and (p.functions is None or p.file not in whole)
        ]

    # Where the code of a stage begins --------------------------------------------------------------------------------

    def _systems(self, stage: str, item: str) -> tuple[list[System], list[Part]]:
        """The systems of a stage as far as they matter to it, and where its code begins.

        A stage that makes a system builds it on the networks that it needs. Any other opens what lies among its
        dependencies of models/, with all that this asks for, and may use whatever it offers.
        """
        file = Part(self.root / "stages" / f"{stage}.py")
        if stage in known():
            # How a system is served does not matter to what is trained.
            own = replace(known()[stage], serves_with=(), offers={})
            roles = filled(stage, self._section)
            needed = [known()[roles[role]] for role in own.needs if roles[role] in known()]
            needs = [System(s.name, s.family, s.model, s.config, package=s.package) for s in needed]
            parts = [part for system in (own, *needs) for part in self._of(system)]
            return [own, *needs], [file, *parts]
        names = served_by(self._read_by(stage, item), self._section)
        opened = [replace(known()[name], build="") for name in names]
        return opened, [file, *(part for system in opened for part in self._of(system))]

    def _of(self, system: System) -> list[Part]:
        """The system's network, the functions that build or open it, and the packages on the way; nothing of what lies
        in another project."""
        family = self.root / "src" / system.module.replace(".", "/")
        functions = tuple(sorted({name for name in (system.build, *system.offers.values()) if name}))
        parts = [Part(family / "__init__.py", ())]
        modules = {place.split(".")[0] for place in (system.model, system.config) if place}
        parts += [Part(family / f"{module}.py") for module in sorted(modules)]
        parts += [Part(family / "system.py", functions)] if functions else []
        return [part for part in parts if part.file.is_file()]

    def _section(self, name: str) -> Mapping[str, Any]:
        found = self._params.get(name)
        return found if isinstance(found, Mapping) else {}

    def _read_by(self, stage: str, item: str) -> list[str]:
        """The systems among the dependencies of a stage; `models` alone is all of them."""
        read = [path.split("/") for path in self._deps.get(stage, []) if path.split("/")[0] == "models"]
        named = [path[1] for path in read if len(path) > 1 and path[1] in known()]
        return [*known()] if ["models"] in read else [*named, *([item] if item in known() else [])]

    def _scores_each(self, stage: str) -> bool:
        return any(path.startswith("models/${item") for path in self._deps.get(stage, []))

    @cached_property
    def _params(self) -> Mapping[str, Any]:
        file = self.root / "params.yaml"
        return self._given if self._given is not None else yaml.safe_load(file.read_text()) if file.is_file() else {}

    @cached_property
    def _deps(self) -> dict[str, list[str]]:
        file = self.root / "dvc.yaml"
        stages = yaml.safe_load(file.read_text())["stages"] if file.is_file() else {}
        return {name: stage.get("do", stage).get("deps", []) for name, stage in stages.items()}

    # What a part is and reaches --------------------------------------------------------------------------------------

    def _tree(self, file: Path) -> ast.Module:
        if file not in self._trees:
            text = file.read_text(encoding="utf-8")
            self._trees[file] = tree = ast.parse(text)
            if "__doc__" not in text:
                _drop_docstrings(tree)
        return self._trees[file]

    def _nodes(self, part: Part) -> list[ast.AST]:
        """The syntax of a module that counts."""
        tree = self._tree(part.file)
        if part.functions is None:
            return [tree]
        defined = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        reached, queue = {}, list(part.functions)
        while queue:
            name = queue.pop()
            if name in defined and name not in reached:
                reached[name] = defined[name]
                queue += [node.id for node in ast.walk(defined[name]) if isinstance(node, ast.Name)]
        return [*(node for node in tree.body if node not in defined.values()), *(reached[n] for n in sorted(reached))]

    def _hash(self, part: Part) -> str:
        """Hash of what counts: syntax of a module, bytes of anything else."""
        if part not in self._digests:
            module = part.file.suffix == ".py"
            self._digests[part] = (
                _digest("\n".join(map(ast.dump, self._nodes(part)))) if module else content_hash(part.file)
            )
        return self._digests[part]

    def _reached(self, part: Part) -> list[Part]:
        """What a part imports, and its data.

        A package that is only passed on the way to a module runs its module level: it is a part with no functions,
        and the modules that it names in tables are not used.
        """
        if part.file.suffix != ".py":
            return []
        if part not in self._imports:
            nodes = self._nodes(part)
            found, passed = imported(self.root / "src", part.file, nodes, tables=part.functions != ())
            infrastructure = self._relative(part.file) in INFRASTRUCTURE
            parts = [] if infrastructure else [Part(file) for file in [*found, *_data(part.file, nodes)]]
            self._imports[part] = [*parts, *(Part(file, ()) for file in passed)]
        return self._imports[part]

    def _relative(self, path: Path) -> str:
        return path.relative_to(self.root).as_posix()


def code_hash(root: Path, name: str, params: Mapping[str, Any] | None = None) -> str:
    """Hash of the listing of a stage (arguments of `Code` and `Code.listing`)."""
    return _digest(Code(root, params).listing(name))


def code_name(stage: str, label: str | None) -> str:
    """The listing of a stage's run with a label: where that is a system, the stage's for this one."""
    return f"{stage}@{label}" if label in known() else stage


def write_code(root: Path) -> None:
    """Writes every listing to FOLDER; one that has not changed stays untouched, one of no stage goes."""
    folder, code = root / FOLDER, Code(root)
    folder.mkdir(exist_ok=True)
    listings = {f"{name}.txt": code.listing(name) for name in code.names()}
    for file in folder.iterdir():
        if file.name not in listings:
            file.unlink()
    for name, text in listings.items():
        if not (folder / name).is_file() or (folder / name).read_text(encoding="utf-8") != text:
            (folder / name).write_text(text, encoding="utf-8")


def _drop_docstrings(tree: ast.Module) -> None:
    """Takes the docstrings out of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node, clean=False):
            del node.body[0]


def _data(file: Path, nodes: Iterable[ast.AST]) -> list[Path]:
    """What a module reads of what lies beside it: the files, and the folders of files, that it names in full."""
    constants = (node for tree in nodes for node in ast.walk(tree) if isinstance(node, ast.Constant))
    names = {node.value for node in constants if isinstance(node.value, str)}
    beside = (path for path in file.parent.iterdir() if path.name in names)
    return [path for path in beside if path.suffix != ".py" and not any(path.glob("*.py"))]


def _digest(text: str) -> str:
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
