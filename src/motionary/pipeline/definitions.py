"""What a module of the project defines, name by name, and which names each definition uses."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

TABLED = re.compile(r"motionary(\.\w+)+(:\w+)?")  # a string that names a module or a function, as tables of readers do
Import = tuple[str, str | None]  # a module, and the name imported from it or None


@dataclass
class Uses:
    """What a piece of syntax uses.

    Attributes:
        names: that stand alone.
        attributes: {name: what is looked up in it}.
        imports: what it imports itself, as a function may.
        texts: its strings.
    """

    names: set[str] = field(default_factory=set)
    attributes: dict[str, set[str]] = field(default_factory=dict)
    imports: list[Import] = field(default_factory=list)
    texts: set[str] = field(default_factory=set)

    def tabled(self) -> list[Import]:
        """The modules and functions of the project that strings name."""
        found = [text.partition(":") for text in sorted(self.texts) if TABLED.fullmatch(text)]
        return [(module, name or None) for module, _, name in found]


class Definitions:
    """The syntax of a module, taken apart; comments, layout and docstrings do not count.

    Attributes:
        nodes: {name: the functions, classes and assignments at the top of the module that define it}.
        imports: {name: the import at the top of the module that binds it}; of other projects too.
        statements: whatever else runs when the module is imported.
    """

    def __init__(self, file: Path, package: tuple[str, ...]):
        """
        Args:
            file: the module.
            package: the packages above it, from the outermost on; relative imports begin there.
        """
        text = file.read_text(encoding="utf-8")
        tree = ast.parse(text)
        if "__doc__" not in text:
            _drop_docstrings(tree)
        self._package = package
        self.nodes: dict[str, list[ast.stmt]] = {}
        self.imports: dict[str, Import] = {}
        self.statements: list[ast.stmt] = []
        self._take_apart(tree.body)

    def uses(self, nodes: Iterable[ast.AST]) -> Uses:
        """What syntax of this module uses, inside functions too, but for types that only a checker imports."""
        found = Uses()
        queue = list(nodes)
        while queue:
            node = queue.pop()
            if isinstance(node, ast.Import | ast.ImportFrom):
                found.imports += [of for _, of in self._bound(node)]
            elif isinstance(node, ast.If) and _for_checkers(node):
                queue += node.orelse
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                found.attributes.setdefault(node.value.id, set()).add(node.attr)
            elif isinstance(node, ast.Name):
                found.names.add(node.id)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.texts.add(node.value)
            else:
                queue += ast.iter_child_nodes(node)
        return found

    def _take_apart(self, body: Iterable[ast.stmt]) -> None:
        for node in body:
            if isinstance(node, ast.If) and _for_checkers(node):
                self._take_apart(node.orelse)
            elif isinstance(node, ast.Import | ast.ImportFrom):
                self.imports |= dict(self._bound(node))
            elif names := _defined(node):
                for name in names:
                    self.nodes.setdefault(name, []).append(node)
            else:
                self.statements.append(node)

    def _bound(self, node: ast.Import | ast.ImportFrom) -> Iterator[tuple[str, Import]]:
        """(name that is bound, what it is) of an import."""
        if isinstance(node, ast.Import):
            # A dotted module is known by its whole name: `import a.b` binds a, and makes sure of b.
            yield from ((alias.asname or alias.name, (alias.name, None)) for alias in node.names)
            return
        above = self._package[: len(self._package) - node.level + 1] if node.level else ()
        module = ".".join((*above, *((node.module,) if node.module else ())))
        yield from ((alias.asname or alias.name, (module, alias.name)) for alias in node.names)


def _for_checkers(node: ast.If) -> bool:
    return isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _defined(node: ast.stmt) -> list[str]:
    """The names that a statement defines and does nothing else; none where it does more."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    parts = [part for target in targets for part in (target.elts if isinstance(target, ast.Tuple) else [target])]
    names = [part.id for part in parts if isinstance(part, ast.Name)]
    return names if len(names) == len(parts) else []


def _drop_docstrings(tree: ast.Module) -> None:
    for node in ast.walk(tree):
        documented = isinstance(node, ast.Module | ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        if documented and ast.get_docstring(node, clean=False):
            del node.body[0]
