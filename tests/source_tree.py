"""The source as its own files say: modules, what each imports, and what that reaches. Nothing is run."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

SRC = Path(__file__).resolve().parents[1] / "src"
NAMED = re.compile(r"(motionary(?:\.\w+)+)(?::\w+)?")  # a string that names a module, as tables of readers do


@cache
def modules() -> dict[str, Path]:
    """Every module of the package: its full name, its file."""
    found = {}
    for file in sorted((SRC / "motionary").rglob("*.py")):
        parts = file.relative_to(SRC).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@cache
def tree(file: Path) -> ast.Module:
    """The syntax of a file."""
    return ast.parse(file.read_text(encoding="utf-8"))


def imported(file: Path) -> set[str]:
    """Full names of what a file imports anywhere: at the top, inside functions, and for the type checker alone."""
    names: set[str] = set()
    for node in ast.walk(tree(file)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative imports are not followed here"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def constants(file: Path) -> set[str]:
    """The strings of a file, docstrings apart."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    prose = {
        id(node.body[0].value)
        for node in ast.walk(tree(file))
        if isinstance(node, documented) and node.body and isinstance(node.body[0], ast.Expr)
    }
    strings = (node for node in ast.walk(tree(file)) if isinstance(node, ast.Constant) and id(node) not in prose)
    return {node.value for node in strings if isinstance(node.value, str)}


@cache
def imports() -> dict[str, frozenset[str]]:
    """The modules of the package that each of them imports, or names in a string that is imported later."""
    known, found = modules(), {}
    for name, file in known.items():
        told = {match.group(1) for text in constants(file) if (match := NAMED.fullmatch(text))}
        told = {name for name in told if name in known and known[name].name != "__init__.py"}  # these name data
        owners = {_owner(target, known) for target in imported(file) | told}
        found[name] = frozenset(owners - {"", name})
    return found


def _owner(name: str, known: Mapping[str, Path]) -> str:
    """The module that an imported name is, or is defined in; "" outside the package."""
    while name and name not in known:
        name = name.rpartition(".")[0]
    return name


def reached(names: Iterable[str], graph: Mapping[str, Iterable[str]]) -> set[str]:
    """These and all that they import, directly or not."""
    found, queue = set(), list(names)
    while queue:
        name = queue.pop()
        if name not in found:
            found.add(name)
            queue += graph.get(name, ())
    return found


def circle(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """A shortest way from a name back to itself, its both ends included; [] where there is none."""
    ways = []
    for start in graph:
        came: dict[str, str] = {}
        queue = [start]
        for name in queue:  # breadth first: the list grows while it is read
            for target in graph.get(name, ()):
                if target not in came:
                    came[target] = name
                    queue.append(target)
            if start in came:
                way = [start]
                while len(way) == 1 or way[-1] != start:
                    way.append(came[way[-1]])
                ways.append(way[::-1])
                break
    return min(ways, key=len, default=[])


def folder_of(name: str) -> str:
    """The top-level folder (or module) of the package that holds a module; "" for the package itself."""
    return name.split(".")[1] if "." in name else ""
