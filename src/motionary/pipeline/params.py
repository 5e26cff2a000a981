"""params.yaml from conf/, exactly as DVC composes it: ``python -m motionary.pipeline.params write|diff|check``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from motionary.pipeline.tracking import flatten


def write_params(root: Path, target: Path, overrides: Sequence[str] = ()) -> None:
    """Composes ``root/conf`` with `overrides` into the file `target`, by DVC's own composition."""
    from dvc.utils.hydra import compose_and_dump

    root = root.resolve()
    compose_and_dump(target, str(root / "conf"), None, "config", str(root / "src"), list(overrides))


def differences(root: Path) -> dict[str, tuple[Any, Any]]:
    """Keys whose value in params.yaml differs from conf's defaults: {key: (params, default)}."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        write_params(root, Path(folder) / "params.yaml")
        default = flatten(yaml.safe_load((Path(folder) / "params.yaml").read_text()))
    actual = flatten(yaml.safe_load((root / "params.yaml").read_text()))
    keys = sorted({*default, *actual})
    return {k: (actual.get(k), default.get(k)) for k in keys if actual.get(k) != default.get(k)}


def main(arguments: Sequence[str]) -> int:
    """``write [OVERRIDE...]`` recomposes params.yaml; ``diff`` says in one line what differs from the defaults;
    ``check`` fails where the file differs at all."""
    root = Path.cwd()
    if not (root / "conf" / "config.yaml").exists():
        print("error: run this in the project's root, where conf/ is", file=sys.stderr)
        return 2
    if arguments[:1] == ["write"]:
        write_params(root, root / "params.yaml", arguments[1:])
        return 0
    if arguments == ["diff"]:
        found = differences(root)
        shown = ", ".join(f"{key}={actual}" for key, (actual, _) in list(found.items())[:8])
        more = f" and {len(found) - 8} more" if len(found) > 8 else ""
        print(f"params.yaml: {shown}{more}" if found else "params.yaml: the defaults of conf/")
        return 0
    if arguments == ["check"]:
        if found := differences(root):
            print(f"params.yaml: {', '.join(found)}: run `make params`", file=sys.stderr)
        return int(bool(found))
    print("usage: python -m motionary.pipeline.params write [OVERRIDE...] | diff | check", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
