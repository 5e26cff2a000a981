"""The house's own rules: imports run one way, names are told apart, and systems are known by what they offer."""

from __future__ import annotations

import ast
from collections import defaultdict

import pytest
from source_tree import SRC, circle, constants, folder_of, imported, imports, modules, reached, tree

from motionary.systems.registry import SYSTEMS

# What a folder stands on: it may import these, and what these may. Errors, files and lazy names serve all.
STANDS_ON = {
    "motion": (),
    "language": (),
    "formats": ("motion",),
    "features": ("motion",),
    "metrics": ("motion",),
    "corpus": ("motion", "formats", "features", "language"),
    "nn": ("language", "features"),  # how many word classes there are, which columns are of one kind
    "systems": ("corpus", "features", "nn"),
    "training": ("systems",),
    "pipeline": ("training",),
    "oracle": ("motion", "metrics"),
    "evaluation": ("systems", "metrics", "oracle"),
    "report": ("evaluation", "formats"),
    "study": ("report", "evaluation", "pipeline"),
    "dictionary": ("systems",),
    "pretrained": ("dictionary", "report"),
    "app": ("dictionary",),
    "archive": ("dictionary",),
    "cli": ("dictionary", "archive", "app", "pretrained", ""),
    "": ("dictionary", "formats", "motion"),
}
SERVE_ALL = {"errors", "files", "text_files", "lazy", "whole"}
LEAVES = {"bench"}  # nothing imports it, and it measures everything
ALLOWED = {
    ("motionary.metrics.captions", "motionary.language.frozen"),  # BERTScore's model, unless another is given
    ("motionary.pipeline.check", "motionary.evaluation.scores"),  # every section is checked before anything runs
    ("motionary.pipeline.check", "motionary.evaluation.style_scores"),
    ("motionary.pipeline.check", "motionary.evaluation.action_scores"),
    ("motionary.formats.read.arrays", "motionary.features"),  # files of HumanML3D features are decoded by their codec
}
WITHOUT_NAMES = ("dictionary", "archive", "cli", "app", "evaluation", "report")
FAMILIES = {system.family for system in SYSTEMS}
NAMES = {system.name for system in SYSTEMS}


def test_no_file_reaches_itself():
    assert len(imports()) > 150
    assert not circle(imports()), " -> ".join(circle(imports()))


def test_no_folder_reaches_itself():
    folders: dict[str, set[str]] = defaultdict(set)
    for name, targets in imports().items():
        folders[folder_of(name)] |= {folder_of(target) for target in targets} - {folder_of(name)}
    assert not circle(folders), " -> ".join(circle(folders))


def test_imports_of_functions_and_of_types_count(tmp_path):
    file = tmp_path / "a.py"
    types = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from c import d\n"
    file.write_text(f"import a.b\n{types}def f():\n    from e import g as h\n")
    assert imported(file) == {"a.b", "typing.TYPE_CHECKING", "c.d", "e.g"}


def test_a_circle_is_found_wherever_it_starts():
    graph = {"a": ["b"], "b": ["c", "d"], "c": ["d"], "d": ["e", "b"], "e": []}
    assert circle(graph) in (["b", "d", "b"], ["d", "b", "d"])
    assert circle(graph | {"d": ["e"]}) == []


def test_imports_run_one_way():
    folders = {folder_of(name) for name, file in modules().items() if file.name == "__init__.py"}
    assert folders == STANDS_ON.keys() | LEAVES, "a new folder says what it stands on"
    wrong = []
    for name, targets in imports().items():
        folder = folder_of(name)
        if folder in LEAVES | SERVE_ALL:
            continue
        may = reached([folder], STANDS_ON) | SERVE_ALL
        wrong += [f"{name} imports {t}" for t in targets if folder_of(t) not in may and (name, t) not in ALLOWED]
    assert not wrong, "\n".join(wrong)


def test_what_serves_all_stands_on_nothing():
    for name in SERVE_ALL:
        assert imports()[f"motionary.{name}"] <= {"motionary.errors", "motionary.files"}


def test_a_family_stands_on_no_other():
    """Families meet in the registry alone; what is shared by several stands beside them or in nn."""
    wrong = []
    for name, targets in imports().items():
        own = _family(name)
        if folder_of(name) == "systems":
            wrong += [f"{name} imports {target}" for target in targets if _family(target) not in ("", own)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("folder", WITHOUT_NAMES)
def test_systems_are_known_by_what_they_offer(folder):
    """No system's name, and no family's code, where systems are used."""
    wrong = []
    for name, file in modules().items():
        if folder_of(name) != folder:
            continue
        wrong += [f"{name} imports {target}" for target in imports()[name] if _family(target)]
        wrong += [f"{name} says {text!r}" for text in constants(file) if NAMES & set(text.split("/"))]
    assert not wrong, "\n".join(wrong)


def test_nothing_is_dispatched_by_what_it_happens_to_have():
    """No hasattr, and nothing looked up in a module that was imported by name, but where tables of names are read."""
    tables = {"motionary.lazy", "motionary.formats.dispatch", "motionary.systems.registry"}
    wrong = []
    for name, file in modules().items():
        for node in ast.walk(tree(file)):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
                continue
            if node.func.id == "hasattr":
                wrong.append(f"{file.relative_to(SRC)}:{node.lineno}: hasattr")
            if node.func.id == "getattr" and "import_module" in ast.dump(node.args[0]) and name not in tables:
                wrong.append(f"{file.relative_to(SRC)}:{node.lineno}: getattr of a module")
    assert not wrong, "\n".join(wrong)


def test_no_two_files_have_one_name():
    files = defaultdict(list)
    for file in SRC.rglob("*.py"):
        files[file.name].append(str(file.relative_to(SRC)))
    shared = {name: paths for name, paths in files.items() if len(paths) > 1}
    assert shared.keys() <= {"__init__.py", "__main__.py", "system.py"}, shared


def test_no_two_public_classes_have_one_name():
    classes = defaultdict(list)
    for name, file in modules().items():
        for node in tree(file).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].append(name)
    shared = {name: places for name, places in classes.items() if len(places) > 1}
    assert not shared, shared


def test_help_names_a_command_as_it_is_typed():
    """A parser of `python -m package.module` says so, and `python -m package` where that is its __main__."""
    found = {}
    for name, file in modules().items():
        for node in ast.walk(tree(file)):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "argparse.ArgumentParser":
                given = {word.arg: word.value for word in node.keywords}
                if "prog" in given and "python -m" in ast.unparse(given["prog"]):
                    found[name] = ast.literal_eval(given["prog"])
    assert len(found) > 5
    assert found == {name: f"python -m {name.removesuffix('.__main__')}" for name in found}


def _family(name: str) -> str:
    """The family that a module belongs to, "" where to none."""
    parts = name.split(".")
    return parts[2] if parts[1:2] == ["systems"] and len(parts) > 2 and parts[2] in FAMILIES else ""
