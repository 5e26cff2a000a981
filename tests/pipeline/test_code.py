"""The code of a stage: what counts, what does not, and which stages a change of one file reaches."""

from __future__ import annotations

import ast
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from motionary.pipeline.code import FOLDER, INFRASTRUCTURE, Code, code_hash, write_code
from motionary.systems.registry import known

TRAINING = {name for name, system in known().items() if system.build}


def made(root: Path, files: dict[str, str], stage: str) -> Path:
    """A project of these files below src/motionary and one stage `s`."""
    for name, text in files.items():
        path = root / "src" / "motionary" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (root / "stages").mkdir()
    (root / "stages" / "s.py").write_text(stage)
    return root / "src" / "motionary"


def names(root: Path) -> list[str]:
    return sorted(path.removeprefix("src/motionary/") for path in Code(root).files("s"))


def test_code_follows_relative_lazy_and_inner_imports_and_tables(tmp_path):
    files = {
        "__init__.py": "",
        "a/__init__.py": '_HOMES = {"Thing": "motionary.a.thing"}\n_P = {"more": ("Other",)}\n',
        "a/thing.py": "from ..b import x\n",
        "a/more.py": "",
        "a/unused.py": "",
        "b.py": "def f():\n    import motionary.c\n",
        "c.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import motionary.a.unused\n",
        "d/__init__.py": 'READERS = {".x": "motionary.d.x:read"}\n',
        "d/x.py": "",
        "e/__init__.py": 'READERS = {".x": "motionary.e.x:read"}\nimport motionary.e.run\n',
        "e/run.py": "",
        "e/x.py": "",
        "e/y.py": "",
    }
    package = made(tmp_path, files, "from motionary.a import Thing, Other\nimport motionary.d\nimport motionary.e.y\n")
    # The package e is only passed on the way to e.y: what it imports runs, what it names in tables does not.
    expected = ["a/__init__.py", "a/more.py", "a/thing.py", "b.py", "c.py", "d/__init__.py", "d/x.py"]
    assert names(tmp_path) == [*expected, "e/__init__.py", "e/run.py", "e/y.py", "stages/s.py"]
    before = code_hash(tmp_path, "s")
    (package / "a" / "unused.py").write_text("unused = True\n")
    assert code_hash(tmp_path, "s") == before
    (package / "c.py").write_text("used = True\n")
    assert code_hash(tmp_path, "s") != before


def test_code_is_also_the_data_that_modules_name(tmp_path):
    files = {
        "a/__init__.py": '"""Words and tables, in one.json."""\n',
        "a/read.py": 'NAMES = "one.json", "tables", "modules"\n',
        "a/modules/two.py": "",
        **{f"a/{name}": "{}" for name in ("one.json", "other.json", "tables/three.json", "unnamed/four.json")},
    }
    package = made(tmp_path, files, "from motionary.a import read\n")
    assert names(tmp_path) == ["a/__init__.py", "a/one.json", "a/read.py", "a/tables", "stages/s.py"]
    before = code_hash(tmp_path, "s")
    (package / "a" / "tables" / "five.json").write_text("{}")
    assert code_hash(tmp_path, "s") != before


def test_comments_docstrings_and_layout_do_not_count_but_a_docstring_that_is_read_does(tmp_path):
    package = made(tmp_path, {"a.py": 'def f(x):\n    """Adds."""\n    return x + 1\n'}, "import motionary.a\n")
    before = code_hash(tmp_path, "s")
    (package / "a.py").write_text('def f(x):\n    """One more."""\n    # plain\n    return (x + 1)\n')
    assert code_hash(tmp_path, "s") == before
    (package / "a.py").write_text('def f(x):\n    """Adds."""\n    return x + 2\n')
    assert code_hash(tmp_path, "s") != before
    texts = ('"""One."""\nprint(__doc__)\n', '"""Two."""\nprint(__doc__)\n')
    hashes = set()
    for text in texts:
        (package / "a.py").write_text(text)
        hashes.add(code_hash(tmp_path, "s"))
    assert len(hashes) == 2


def test_what_a_stage_cannot_use_does_not_count(tmp_path):
    files = {
        "__init__.py": "",
        "a.py": "from motionary import b\nfrom motionary.c import Base, other\nLEFT, RIGHT = 0, 1\n"
        "class Used(Base):\n    def f(self):\n        return _inner(LEFT) + b.g()\n"
        "def _inner(x):\n    return x\ndef unused():\n    return other()\n",
        "b.py": "def g():\n    return 1\ndef h():\n    return 2\n",
        "c.py": "import math\nfrom motionary.d import value\nclass Base:\n    pass\ndef other():\n    return value\n",
        "d.py": "value = 1\nprint(value)\n",
    }
    package = made(tmp_path, files, "from motionary.a import Used as U\nU().f()\n")
    assert {"a.py:Used", "a.py:_inner", "a.py:LEFT", "a.py:RIGHT", "b.py:g", "c.py:Base", "d.py:value"} == {
        place.removeprefix("src/motionary/") for place in Code(tmp_path).places("s") if ":" in place and "src" in place
    }
    before = code_hash(tmp_path, "s")
    unseen = [("a.py", "other()", "0"), ("b.py", "return 2", "return 3"), ("c.py", "return value", "return 0")]
    seen = [
        ("a.py", "LEFT, RIGHT = 0, 1", "LEFT, RIGHT = 1, 0"),
        ("b.py", "return 1", "return 3"),
        ("d.py", "= 1", "= 2"),
    ]
    for file, old, new in (*unseen, *seen):
        assert old in files[file]
        (package / file).write_text(files[file].replace(old, new))
        assert (code_hash(tmp_path, "s") != before) == ((file, old, new) in seen), (file, old)
        (package / file).write_text(files[file])


def test_a_name_that_means_something_else_counts(tmp_path):
    files = {"__init__.py": "", "a.py": "from math import cos as f\ndef g():\n    return f(1)\n"}
    package = made(tmp_path, files, "from motionary.a import g\ng()\n")
    before = code_hash(tmp_path, "s")
    (package / "a.py").write_text(files["a.py"].replace("cos", "sin"))
    assert code_hash(tmp_path, "s") != before


def test_what_is_called_infrastructure_exists(repository):
    for path in INFRASTRUCTURE:
        assert (repository / path).exists(), path


# Which stages a change reaches ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def project(repository, tmp_path_factory) -> Path:
    """A copy of the code of this project."""
    root = tmp_path_factory.mktemp("code")
    for name in ("stages", "src"):
        shutil.copytree(repository / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("dvc.yaml", "params.yaml"):
        shutil.copy(repository / name, root / name)
    return root


def mended(text: str) -> str:
    """A module with a statement more in each of its functions."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.body.append(ast.parse("_changed = True").body[0])
    return ast.unparse(tree)


def listings(root: Path) -> dict[str, str]:
    code = Code(root)
    return {name: code.listing(name) for name in code.names()}


@pytest.fixture(scope="module")
def reached(project):
    """reached(file, old, new): the listings that change with a file of the package, by a text that is replaced or,
    without one, by a statement more in every function."""
    before = listings(project)

    def changed(file: str, old: str | None = None, new: str = "") -> set[str]:
        path = project / "src" / "motionary" / file
        text = path.read_text()
        assert old is None or old in text
        path.write_text(mended(text) if old is None else text.replace(old, new))
        after = listings(project)
        path.write_text(text)
        return {name for name, listing in before.items() if after[name] != listing}

    return changed


@pytest.mark.parametrize("reader", ["formats/read/bvh.py", "formats/read/acclaim.py", "formats/read/arrays.py"])
def test_a_mended_reader_reaches_what_reads_files_and_nothing_else(reached, reader):
    assert reached(reader) == {"source", "preprocess"}


def test_how_files_are_read_reaches_no_training(reached):
    for file in ("formats/read/__init__.py", "formats/measure/unit.py", "corpus/clips.py"):
        assert not reached(file) & TRAINING, file


def test_how_a_system_answers_reaches_what_asks_it_and_no_training(reached):
    assert reached("systems/tm2t/captioner.py") == {"evaluation@motion2text", "report"}
    assert reached("systems/tm2t/token_generator.py") == {
        "evaluation@text2token",
        "evaluation@inverse_alignment",
        "report",
    }
    assert reached("systems/stylization/style_transfer.py") == {
        "style_evaluation",
        "evaluation@stylization",
        "report",
    }


def test_a_function_of_a_family_reaches_what_it_builds_or_opens(reached):
    changed = reached(
        "systems/t2m/system.py", "return Lengths(trained.load(name))", "return Lengths(trained.load(name[:]))"
    )
    # These answer with lengths.
    readers = {"text2length", "text2motion", "temos", "masked_generator", "masked_autoregression"}
    assert changed == {f"evaluation@{name}" for name in readers} | {"report"}


def test_a_metric_reaches_no_training_a_network_what_stands_on_it_and_the_loop_all(reached):
    assert not reached("metrics/distribution.py") & TRAINING
    answering = {"style_evaluation", "evaluation@global_motion", "evaluation@stylization", "report"}
    assert reached("systems/stylization/global_motion.py") == {"global_motion", *answering}
    assert not TRAINING - reached("training/loop.py")


def test_what_another_system_in_a_role_brings_counts(project):
    listing = Code(project, {"text2token": {"tokenizer": "autoencoder"}}).listing("text2token")
    assert "src/motionary/systems/t2m/autoencoder.py" in listing
    assert "src/motionary/systems/t2m/autoencoder.py" not in Code(project).listing("text2token")


def test_the_registry_reaches_the_systems_whose_entry_changes(project, monkeypatch):
    before = {name: code_hash(project, name) for name in ("tokenizer", "text2token", "autoencoder")}
    monkeypatch.setitem(known(), "tokenizer", replace(known()["tokenizer"], config="tokenizer.Other"))
    changed = {name for name in before if code_hash(project, name) != before[name]}
    assert changed == {"tokenizer", "text2token"}
    monkeypatch.setitem(known(), "autoencoder", replace(known()["autoencoder"], offers={}))
    assert code_hash(project, "autoencoder") == before["autoencoder"]  # served otherwise, trained alike


def test_a_listing_that_has_not_changed_is_left_alone(project):
    write_code(project)
    folder = project / FOLDER
    assert {file.stem for file in folder.iterdir()} == set(Code(project).names())
    stamps = {file.name: file.stat().st_mtime_ns for file in folder.iterdir()}
    (folder / "gone.txt").write_text("of a stage that is no more")
    loop = project / "src/motionary/systems/tm2t/captioner.py"
    text = loop.read_text()
    loop.write_text(mended(text))
    write_code(project)
    loop.write_text(text)
    changed = {file.stem for file in folder.iterdir() if file.stat().st_mtime_ns != stamps[file.name]}
    assert changed == {"evaluation@motion2text", "report"}
