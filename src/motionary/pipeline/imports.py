"""Which files of the project a piece of syntax imports, at once or lazily."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable
from pathlib import Path

PROJECT = "motionary"
MODULE = re.compile(PROJECT + r"(\.\w+)+(:\w+)?")  # a string that names a module, as tables of readers do


def imported(source: Path, file: Path, nodes: Iterable[ast.AST], tables: bool) -> tuple[list[Path], list[Path]]:
    """The files that `nodes` import anywhere, also inside functions, and the packages that run on the way to them.

    Args:
        source: the folder of the project's packages.
        file: that holds the syntax.
        nodes: the syntax.
        tables: whether modules that a string names count as imported.
    """
    found: list[Path] = []
    passed: list[Path] = []
    for module, name in _named(source, file, nodes, tables):
        files, packages = _resolve(source, module, name)
        found += files
        passed += packages
    return found, passed


def _named(source: Path, file: Path, nodes: Iterable[ast.AST], tables: bool) -> list[tuple[str, str | None]]:
    """(module, name imported from it or None) of every import."""
    names: list[tuple[str, str | None]] = []
    queue = list(nodes)
    while queue:
        node = queue.pop()
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if tables and MODULE.fullmatch(node.value):
                names.append((node.value.split(":")[0], None))
        elif isinstance(node, ast.Import):
            names += [(alias.name, None) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [(_absolute(source, file, node), alias.name) for alias in node.names]
        elif isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            queue += node.orelse  # the body is for the type checker only
        else:
            queue += ast.iter_child_nodes(node)
    return names


def _absolute(source: Path, file: Path, node: ast.ImportFrom) -> str:
    """The imported module's full name, also for relative imports."""
    if not node.level:
        return node.module or ""
    package = file.relative_to(source).with_suffix("").parts[: -node.level]
    return ".".join((*package, *((node.module,) if node.module else ())))


def _resolve(source: Path, module: str, name: str | None) -> tuple[list[Path], list[Path]]:
    """The files of a module, or of a name in it, and the packages above it; nothing for other projects' modules."""
    parts = module.split(".")
    if parts[0] != PROJECT:
        return [], []
    base = source.joinpath(*parts)
    passed = [init for i in range(1, len(parts)) if (init := source.joinpath(*parts[:i], "__init__.py")).exists()]
    if base.with_suffix(".py").exists():
        return [base.with_suffix(".py")], passed
    init = base / "__init__.py"
    if name is not None and (_is_module(base / name)):
        files, packages = _resolve(source, f"{module}.{name}", None)
        return files, packages
    if not init.exists():
        return [], passed
    home = _lazy_homes(init, module).get(name or "")
    if home is None:
        return [init], passed
    files, packages = _resolve(source, home, name)
    return files, [*passed, init, *packages]


def _is_module(base: Path) -> bool:
    return base.with_suffix(".py").exists() or (base / "__init__.py").exists()


def _lazy_homes(init: Path, package: str) -> dict[str, str]:
    """Name -> module of names that a package hands on lazily: literal dicts {name: "motionary.module"} or
    {"module": (names...)}."""
    homes: dict[str, str] = {}
    for node in ast.walk(ast.parse(init.read_text(encoding="utf-8"))):
        for key, value in zip(node.keys, node.values, strict=True) if isinstance(node, ast.Dict) else ():
            if not isinstance(key, ast.Constant):
                continue
            if (
                isinstance(value, ast.Constant)
                and str(value.value).startswith(f"{PROJECT}.")
                and ":" not in str(value.value)
            ):
                homes[str(key.value)] = str(value.value)
            elif isinstance(value, (ast.Tuple, ast.List)):
                names = [str(item.value) for item in value.elts if isinstance(item, ast.Constant)]
                homes |= {name: f"{package}.{key.value}" for name in names}
    return homes
