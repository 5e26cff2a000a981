"""Which modules, and which data of the package, a stage uses, found in its imports.

``python -m motionary.pipeline.dependencies`` writes them into dvc.yaml, so that a stage runs again exactly when code
that can change its outputs has changed.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import yaml

from motionary.pipeline.workspace import content_hash
from motionary.systems.registry import find, known, served_by

# Bookkeeping that cannot change what a stage computes. Of the registry only a stage's own systems matter: see
# `system_parts`.
INFRASTRUCTURE = frozenset(
    f"src/motionary/{name}.py"
    for name in (
        "__init__",
        "errors",
        "lazy",
        "pipeline/__init__",
        "pipeline/dependencies",
        "pipeline/learning_curves",
        "pipeline/stage",
        "pipeline/tracking",
        "pipeline/workspace",
        "systems/__init__",
        "systems/registry",
        "training/__init__",
    )
)
MODULE = re.compile(r"motionary(\.\w+)+(:\w+)?")  # a string that names a module, as tables of readers do


@dataclass(frozen=True)
class Part:
    """A file, or of it what these functions reach: its module level, themselves, and what they call there."""

    file: Path
    functions: tuple[str, ...] = ()

    def nodes(self) -> list[ast.AST]:
        """The syntax that counts."""
        tree = ast.parse(self.file.read_text())
        if not self.functions:
            return [tree]
        defined = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        reached, queue = {}, list(self.functions)
        while queue:
            name = queue.pop()
            if name in defined and name not in reached:
                reached[name] = defined[name]
                queue += [node.id for node in ast.walk(defined[name]) if isinstance(node, ast.Name)]
        return [*(node for node in tree.body if node not in defined.values()), *reached.values()]


def code_dependencies(root: Path, *parts: Path | Part) -> list[str]:
    """Sorted paths, relative to `root`, of these files, every project module that they reach, and the data of these."""
    found: set[Path] = set()
    seen: set[Part] = set()
    queue = [part if isinstance(part, Part) else Part(part) for part in parts]
    while queue:
        part = queue.pop()
        if part in seen:
            continue
        seen.add(part)
        found.add(part.file)
        if part.file.relative_to(root).as_posix() not in INFRASTRUCTURE:
            for tree in part.nodes():
                queue += [Part(file) for file in _imported(root / "src", part.file, tree)]
                found.update(_data(part.file, tree))
    paths = {path.relative_to(root).as_posix() for path in found}
    return sorted(paths - INFRASTRUCTURE)


def system_parts(root: Path, names: Iterable[str], uses: str) -> list[Part]:
    """The code of systems: their networks, and what builds or what opens them, by `uses`: "build", "offers" or ""."""
    parts = []
    for name in dict.fromkeys(names):
        system = find(name)
        folder = root / "src" / system.module.replace(".", "/")
        functions = {"build": (system.build,), "offers": tuple(system.offers.values())}.get(uses, ())
        if any(functions):
            parts.append(Part(folder / "system.py", functions))
        if system.model:
            parts.append(Part(folder / f"{system.model.split('.')[0]}.py"))
    return [part for part in parts if part.file.is_file()]  # a system of another package lies elsewhere


def code_hash(root: Path, stage: str) -> str:
    """Hash of the code of a stage: its file, every project module that this reaches, and the systems that it loads."""
    return content_hash(*(root / path for path in code_dependencies(root, *stage_parts(root, stage))))


def stage_parts(root: Path, stage: str, reads: Iterable[str] = ()) -> list[Path | Part]:
    """Where the code of a stage begins: its file, and how it builds its own system on what that needs, or, in a stage
    of no system, how it opens the systems that it `reads`."""
    file = root / "stages" / f"{stage}.py"
    if stage in known():
        return [file, *system_parts(root, [stage], "build"), *system_parts(root, known()[stage].needs, "")]
    return [file, *system_parts(root, served_by([name for name in reads if name in known()]), "offers")]


def _data(file: Path, tree: ast.AST) -> list[Path]:
    """What a module reads of what lies beside it: the files, and the folders of files, that it names in full."""
    names = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    beside = (path for path in file.parent.iterdir() if path.name in names)
    return [path for path in beside if path.suffix != ".py" and not any(path.glob("*.py"))]


def _imported(source: Path, file: Path, tree: ast.AST) -> list[Path]:
    """Project files that `file` imports anywhere, also inside functions; lazily handed on names count."""
    files: list[Path] = []
    queue: list[ast.AST] = [tree]
    while queue:
        node = queue.pop()
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and MODULE.fullmatch(node.value):
            files += _resolve(source, node.value.split(":")[0], None)
        elif isinstance(node, ast.Import):
            for alias in node.names:
                files += _resolve(source, alias.name, None)
        elif isinstance(node, ast.ImportFrom):
            module = _absolute(source, file, node)
            for alias in node.names:
                files += _resolve(source, module, alias.name)
        elif isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            queue += node.orelse  # the body is for the type checker only
        else:
            queue += ast.iter_child_nodes(node)
    return files


def _absolute(source: Path, file: Path, node: ast.ImportFrom) -> str:
    """The imported module's full name, also for relative imports."""
    if not node.level:
        return node.module or ""
    package = file.relative_to(source).with_suffix("").parts[: -node.level]
    return ".".join((*package, *((node.module,) if node.module else ())))


def _resolve(source: Path, module: str, name: str | None) -> list[Path]:
    if module.split(".")[0] != "motionary":
        return []
    base = source.joinpath(*module.split("."))
    if name is not None and (base / f"{name}.py").exists():
        return [base / f"{name}.py"]
    if name is not None and (base / name / "__init__.py").exists():
        return [base / name / "__init__.py"]
    if base.with_suffix(".py").exists():
        return [base.with_suffix(".py")]
    init = base / "__init__.py"
    if not init.exists():
        return []
    files = [init]
    for key, home in _lazy_homes(init).items():
        if key == name:
            files += _resolve(source, home, None)
    return files


def _lazy_homes(init: Path) -> dict[str, str]:
    """Name -> module of names that a package hands on lazily: literal dicts {name: "motionary.module"} or
    {"module": (names...)}."""
    homes: dict[str, str] = {}
    for node in ast.walk(ast.parse(init.read_text())):
        for key, value in zip(node.keys, node.values, strict=True) if isinstance(node, ast.Dict) else ():
            if not isinstance(key, ast.Constant):
                continue
            if isinstance(value, ast.Constant) and str(value.value).startswith("motionary."):
                homes[str(key.value)] = str(value.value)
            elif isinstance(value, (ast.Tuple, ast.List)):
                names = [str(item.value) for item in value.elts if isinstance(item, ast.Constant)]
                homes |= {name: f"{_package(init)}.{key.value}" for name in names}
    return homes


def _package(init: Path) -> str:
    parts = init.parent.parts
    last = len(parts) - 1 - parts[::-1].index("motionary")
    return ".".join(parts[last:])


def rewrite(root: Path) -> str:
    """The text of dvc.yaml with every stage's code dependencies brought up to date.

    These are what its file imports and the code of each model that it reads, since models are opened by name.
    """
    text = (root / "dvc.yaml").read_text()
    stages = {name: stage.get("do", stage) for name, stage in yaml.safe_load(text)["stages"].items()}
    out: list[str] = []
    files: list[Path | Part] = []
    for line in text.splitlines():
        command = re.search(r"python stages/(\w+)\.py", line)
        if command:
            read = re.findall(r"^models/(\w+)$", "\n".join(stages[command.group(1)]["deps"]), re.MULTILINE)
            files = stage_parts(root, command.group(1), read)
        if re.match(r"\s+- (stages|src)/", line):
            continue
        out.append(line)
        if files and re.match(r"\s+deps:\s*$", line):
            indent = re.match(r"\s+", line).group()  # type: ignore[union-attr]
            out += [f"{indent}  - {path}" for path in code_dependencies(root, *files)]
            files = []
    return "\n".join(out) + "\n"


if __name__ == "__main__":
    project = Path.cwd()
    new = rewrite(project)
    if "--check" in sys.argv:
        sys.exit(0 if new == (project / "dvc.yaml").read_text() else "dvc.yaml: run `make deps`")
    (project / "dvc.yaml").write_text(new)
