"""Where in the project an imported module or name is defined."""

from __future__ import annotations

import ast
from pathlib import Path

PROJECT = "motionary"


def located(source: Path, module: str, name: str | None) -> tuple[list[tuple[Path, str | None]], list[Path]]:
    """Where an import leads, and the packages that run on the way to it; nothing for other projects' modules.

    Args:
        source: the folder of the project's packages.
        module: full name of the module.
        name: what is imported from it, None for the module itself.

    Returns:
        [(file, name in it, or None for all of the file)], and the ``__init__.py`` of the packages above, outermost
        first. A name that a package hands on lazily is followed to its home.
    """
    parts = module.split(".")
    if parts[0] != PROJECT:
        return [], []
    base = source.joinpath(*parts)
    passed = [init for i in range(1, len(parts)) if (init := source.joinpath(*parts[:i], "__init__.py")).exists()]
    if base.with_suffix(".py").exists():
        return [(base.with_suffix(".py"), name)], passed
    init = base / "__init__.py"
    if name is not None and _is_module(base / name):
        return located(source, f"{module}.{name}", None)
    if not init.exists():
        return [], passed
    home = _lazy_homes(init, module).get(name or "")
    if home is None:
        return [(init, name)], passed
    found, packages = located(source, home, name)
    return found, [*passed, init, *packages]


def _is_module(base: Path) -> bool:
    return base.with_suffix(".py").exists() or (base / "__init__.py").exists()


def _lazy_homes(init: Path, package: str) -> dict[str, str]:
    """{name: module} of the names that a package passes on lazily, read from its literal dicts: {name:
    "motionary.module"} or {"module": (names...)}."""
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
