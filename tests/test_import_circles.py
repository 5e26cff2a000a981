"""No two modules need each other, directly or through others; imports for types and inside functions count."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src"


def imports(sources: dict[str, str]) -> dict[str, set[str]]:
    """The modules among `sources` (name: text) that each of them imports, wherever in its text."""
    found: dict[str, set[str]] = {}
    for name, text in sources.items():
        nodes = list(ast.walk(ast.parse(text)))
        named = {f"{n.module}.{a.name}" for n in nodes if isinstance(n, ast.ImportFrom) for a in n.names}
        named |= {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        # A name that is no module stands in the one before its last dot.
        modules = {full if full in sources else full.rpartition(".")[0] for full in named}
        found[name] = {module for module in modules if module in sources and module != name}
    return found


def test_a_circle_through_types_is_seen():
    lazy = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from a import x\n"
    with pytest.raises(CycleError):
        TopologicalSorter(imports({"a": "def f():\n    from b import y\n", "b": "import c", "c": lazy})).prepare()
    TopologicalSorter(imports({"a": "import b", "b": "import c", "c": "import os"})).prepare()


def test_the_project_has_no_circle():
    names = {path: path.relative_to(SOURCE).with_suffix("").parts for path in SOURCE.rglob("*.py")}
    sources = {".".join(parts).removesuffix(".__init__"): path.read_text("utf-8") for path, parts in names.items()}
    assert {"motionary.nn.layers", "motionary.systems", "motionary.systems.registry"} <= sources.keys()
    try:
        TopologicalSorter(imports(sources)).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))
