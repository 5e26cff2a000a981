"""What the code of a stage is: every function, class and table of the project that the stage can use, found by
following names from the stage's file on.

The stage `code` writes it down before all others, one listing for each stage; DVC compares the listings, so that a
stage runs again exactly when code that can change its outputs has changed. A line is the hash of one definition and
where it stands, so that two listings tell what has changed. Comments, docstrings, layout, and functions beside those
that the stage can use do not count.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from motionary.pipeline.definitions import Definitions, Import, Uses
from motionary.pipeline.imports import located
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
        "pipeline/definitions",
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
        "whole",
    )
)
ALL, TOP = "*", ""
# A file, and what of it counts: a name that it defines, ALL that it defines, or TOP, what runs when it is imported.
Part = tuple[Path, str]


class Code:
    """The code of the project in `root` as it is now; every file is parsed once.

    Args:
        root: folder of the project.
        params: the configuration, which says what system fills a role; None takes params.yaml.
    """

    def __init__(self, root: Path, params: Mapping[str, Any] | None = None):
        self.root, self._given = root, params
        self._modules: dict[Path, Definitions] = {}
        self._digests: dict[Part, str] = {}
        self._used: dict[Part, Uses] = {}
        self._names: dict[Path, str] = {}
        self._reached: dict[Part, list[Part]] = {}
        self._beside: dict[Path, dict[str, Path]] = {}

    def names(self) -> list[str]:
        """What there are listings of: a stage, or, where a stage scores one system after the other, it and a system."""
        stages = [file.stem for file in sorted((self.root / "stages").glob("[!_]*.py"))]
        each = {stage: [f"{stage}@{system}" for system in known()] for stage in stages if self._scores_each(stage)}
        return [name for stage in stages for name in each.get(stage, [stage])]

    def listing(self, name: str) -> str:
        """Hash and place of all code that counts for a stage (as `names` has it), a line each."""
        systems, parts = self._systems(*name.partition("@")[::2])
        hashes = {self._place(part): self._hash(part) for part in self.reach(parts)}
        lines = [f"{hashes[place]} {place}" for place in sorted(hashes) if hashes[place]]
        return "\n".join([*lines, *map(repr, systems)]) + "\n"

    def files(self, name: str) -> set[str]:
        """Paths, relative to the project, of the files and folders that a listing looks into."""
        return {self._relative(file) for file, _ in self.reach(self._systems(*name.partition("@")[::2])[1])}

    def places(self, name: str) -> set[str]:
        """``file:name`` of every definition in a listing, the path relative to the project."""
        return {self._place(part) for part in self.reach(self._systems(*name.partition("@")[::2])[1])}

    def reach(self, parts: Iterable[Part]) -> list[Part]:
        """These parts, every part of the project that they use, and the data of all these; no infrastructure."""
        seen: set[Part] = set()
        queue = list(parts)
        while queue:
            part = queue.pop()
            if part not in seen:
                seen.add(part)
                queue += self._next(part)
        return [part for part in seen if part[1] != ALL and not self._infrastructure(part[0])]

    # Where the code of a stage begins --------------------------------------------------------------------------------

    def _systems(self, stage: str, item: str) -> tuple[list[System], list[Part]]:
        """The systems of a stage as far as they matter to it, and where its code begins.

        A stage that makes a system builds it on the networks that it needs. Any other opens what lies among its
        dependencies of models/, with all that this asks for, and may use whatever it offers.
        """
        file = (self.root / "stages" / f"{stage}.py", ALL)
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
        """The system's network, its settings, and the functions that build or open it; nothing of another project."""
        functions = [f"system.{name}" for name in (system.build, *system.offers.values()) if name]
        places = [place.split(".") for place in (system.model, system.config, *functions) if place]
        found = [part for module, name in places for part in self._lead((f"{system.module}.{module}", name))]
        return [part for part in found if part[0].is_file()]

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

    def _module(self, file: Path) -> Definitions:
        if file not in self._modules:
            inside = file.is_relative_to(self._source)
            self._modules[file] = Definitions(file, file.relative_to(self._source).parts[:-1] if inside else ())
        return self._modules[file]

    def _nodes(self, part: Part) -> list[ast.stmt]:
        module = self._module(part[0])
        return module.statements if part[1] == TOP else module.nodes.get(part[1], [])

    def _uses(self, part: Part) -> Uses:
        if part not in self._used:
            self._used[part] = self._module(part[0]).uses(self._nodes(part))
        return self._used[part]

    def _hash(self, part: Part) -> str:
        """Hash of the syntax of a definition and of what its names mean, or of the bytes of data; "" of nothing."""
        if part not in self._digests:
            file = part[0]
            self._digests[part] = self._digest_of(part) if file.suffix == ".py" else content_hash(file)
        return self._digests[part]

    def _digest_of(self, part: Part) -> str:
        nodes, module, used = self._nodes(part), self._module(part[0]), self._uses(part)
        if not nodes:
            return ""
        meant = [f"{name}={module.imports[name]}" for name in module.imports if name in used.names | {*used.attributes}]
        return _digest("\n".join([*map(ast.dump, nodes), *sorted(meant)]))

    def _next(self, part: Part) -> list[Part]:
        """What a part uses, and its data. Of infrastructure only the packages on the way to it run."""
        file, name = part
        if file.suffix != ".py":
            return []
        if part not in self._reached:
            module = self._module(file)
            if self._infrastructure(file):
                found = [p for of in module.imports.values() for p in self._lead(of) if p[1] == TOP]
            elif name == TOP:
                found = self._run_by(module)
            elif name == ALL:
                found = [(file, TOP), *((file, defined) for defined in (*module.nodes, *module.imports))]
            elif name in module.nodes:
                found = [(file, TOP)]
            elif name in module.imports:
                found = [(file, TOP), *self._lead(module.imports[name])]
            else:
                found = [(file, ALL)]
            if not self._infrastructure(file):
                found = [*found, *self._used_by(file, self._uses(part))]
            self._reached[part] = found
        return self._reached[part]

    def _run_by(self, module: Definitions) -> list[Part]:
        """What an import of a module runs: other modules, of which nothing is used yet."""
        found = [(of, self._lead(of)) for of in module.imports.values()]
        return [(file, TOP if of[1] else name) for of, parts in found for file, name in parts]

    def _used_by(self, file: Path, used: Uses) -> list[Part]:
        """What syntax in a file uses: definitions beside it, imported ones, what its strings name, and data."""
        module, found = self._module(file), list[Part]()
        for name in used.names | used.attributes.keys():
            if name in module.nodes:
                found.append((file, name))
            elif name in module.imports:
                found += self._lead(
                    module.imports[name], used.attributes.get(name, ()) if name not in used.names else ()
                )
        found += [part for of in used.imports for part in self._lead(of)]
        # A package that a string names holds data that is read; what its modules define is not used by that.
        packages = [(part, part[0].name == "__init__.py") for of in used.tabled() for part in self._lead(of)]
        found += [(part[0], TOP) if package and part[1] == ALL else part for part, package in packages]
        beside = self._files_beside(file)
        return [*found, *((beside[text], TOP) for text in used.texts & beside.keys())]

    def _lead(self, of: Import, attributes: Iterable[str] = ()) -> list[Part]:
        """The parts that an import leads to; where it is a module, of which only attributes are looked up, these."""
        found, passed = located(self._source, *of)
        parts: list[Part] = [(init, TOP) for init in passed]
        for file, name in found:
            names = [name] if name else [*attributes] or [ALL]
            parts += [(file, name) for name in names]
        return parts

    def _files_beside(self, file: Path) -> dict[str, Path]:
        """Files, and folders of files, in the folder of a module that are no code, by name."""
        if file.parent not in self._beside:
            data = [path for path in file.parent.iterdir() if path.suffix != ".py" and not any(path.glob("*.py"))]
            self._beside[file.parent] = {path.name: path for path in data}
        return self._beside[file.parent]

    @property
    def _source(self) -> Path:
        return self.root / "src"

    def _infrastructure(self, file: Path) -> bool:
        return self._relative(file) in INFRASTRUCTURE

    def _place(self, part: Part) -> str:
        return ":".join(filter(None, (self._relative(part[0]), part[1])))

    def _relative(self, path: Path) -> str:
        if path not in self._names:
            self._names[path] = path.relative_to(self.root).as_posix()
        return self._names[path]


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


def _digest(text: str) -> str:
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
