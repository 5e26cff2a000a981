"""Which modules, and which data of the package, a stage uses, found in its imports.

``python -m motionary.training.dependencies`` writes them into dvc.yaml, so that a stage runs again exactly when code
that can change its outputs has changed.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

import yaml

from motionary.training.workspace import content_hash

# Bookkeeping that cannot change what a stage computes.
INFRASTRUCTURE = frozenset(
    f"src/motionary/{name}.py"
    for name in (
        "__init__",
        "errors",
        "training/__init__",
        "training/curves",
        "training/stage",
        "training/tracking",
        "training/workspace",
    )
)


def code_dependencies(root: Path, *files: Path) -> list[str]:
    """Sorted paths, relative to `root`, of these files, every project module that they reach, and the data of these."""
    found: set[Path] = set()
    queue = list(files)
    while queue:
        file = queue.pop()
        if file in found:
            continue
        found.add(file)
        if file.relative_to(root).as_posix() not in INFRASTRUCTURE:
            tree = ast.parse(file.read_text())
            queue += _imported(root / "src", file, tree)
            found.update(_data(file, tree))
    paths = {path.relative_to(root).as_posix() for path in found}
    return sorted(paths - INFRASTRUCTURE)


def code_hash(root: Path, stage: str) -> str:
    """Hash of the code of a stage: its file and every project module that this reaches."""
    return content_hash(*(root / path for path in code_dependencies(root, root / "stages" / f"{stage}.py")))


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
        if isinstance(node, ast.Import):
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
    files: list[Path] = []
    for line in text.splitlines():
        command = re.search(r"python stages/(\w+)\.py", line)
        if command:
            read = re.findall(r"^models/(\w+)$", "\n".join(stages[command.group(1)]["deps"]), re.MULTILINE)
            files = [root / "src" / "motionary" / "models" / f"{name}.py" for name in read]
            files.append(root / "stages" / f"{command.group(1)}.py")
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
