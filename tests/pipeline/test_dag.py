"""The map: names run from end to end, code dependencies are the real imports."""

import yaml

from motionary.pipeline.dependencies import INFRASTRUCTURE, code_dependencies, code_hash, rewrite
from motionary.systems.registry import find

# Stages without a model of their own.
PLAIN = {"source", "preprocess", "evaluation", "style_evaluation", "report"}


def stages(repository):
    loaded = yaml.safe_load((repository / "dvc.yaml").read_text())["stages"]
    return {name: stage.get("do", stage) for name, stage in loaded.items()}


def test_one_name_from_end_to_end(repository):
    files = {file.stem for file in (repository / "stages").glob("[!_]*.py")}
    assert files == set(stages(repository))
    for name, stage in stages(repository).items():
        assert f"python stages/{name}.py ${{composed}}" in stage["cmd"]
        assert stage["desc"]
        if name in PLAIN:
            continue
        assert (repository / "conf" / f"{name}.yaml").exists()
        assert find(name).name == name
        assert f"models/{name}" in stage["outs"]
        params = yaml.safe_load((repository / "params.yaml").read_text())
        assert name in params
        assert name in stage["params"]


def test_a_stage_that_draws_depends_on_its_seed(repository):
    params = yaml.safe_load((repository / "params.yaml").read_text())
    for name, stage in stages(repository).items():
        code = (repository / "stages" / f"{name}.py").read_text()
        draws = "stage.seed" in code or "train(" in code
        own = "seed" in params.get(name, {})  # the judge's: systems of all seeds meet the same one
        assert own == (name in ("autoencoder", "evaluator"))
        assert ("seed" in stage.get("params", [])) == (draws and not own), name


def test_dependencies_are_the_imports(repository):
    assert rewrite(repository) == (repository / "dvc.yaml").read_text(), "run `make deps`"


def test_dependencies_follow_relative_lazy_and_inner_imports(tmp_path):
    package = tmp_path / "src" / "motionary"
    (package / "a").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "a" / "__init__.py").write_text('_HOMES = {"Thing": "motionary.a.thing"}\n_P = {"more": ("Other",)}\n')
    (package / "a" / "thing.py").write_text("from ..b import x\n")
    (package / "a" / "more.py").write_text("")
    (package / "a" / "unused.py").write_text("")
    (package / "b.py").write_text("def f():\n    import motionary.c\n")
    (package / "c.py").write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import motionary.a.unused\n"
    )
    stage = tmp_path / "stages" / "s.py"
    stage.parent.mkdir()
    stage.write_text("from motionary.a import Thing, Other\n")
    found = code_dependencies(tmp_path, stage)
    names = [path.removeprefix("src/motionary/") for path in found]
    assert names == ["a/__init__.py", "a/more.py", "a/thing.py", "b.py", "c.py", "stages/s.py"]
    before = code_hash(tmp_path, "s")
    (package / "a" / "unused.py").write_text("unused = True\n")
    assert code_hash(tmp_path, "s") == before
    (package / "c.py").write_text("used = True\n")
    assert code_hash(tmp_path, "s") != before


def test_dependencies_are_also_the_data_that_modules_name(tmp_path, repository):
    package = tmp_path / "src" / "motionary"
    for folder in ("a/tables", "a/modules", "a/unnamed"):
        (package / folder).mkdir(parents=True)
    (package / "a" / "__init__.py").write_text('"""Words and tables, in one.json."""\n')
    (package / "a" / "read.py").write_text('NAMES = "one.json", "tables", "modules"\n')
    (package / "a" / "modules" / "two.py").write_text("")
    for name in ("one.json", "other.json", "tables/three.json", "unnamed/four.json"):
        (package / "a" / name).write_text("{}")
    stage = tmp_path / "stages" / "s.py"
    stage.parent.mkdir()
    stage.write_text("from motionary.a import read\n")
    found = code_dependencies(tmp_path, stage)
    names = [path.removeprefix("src/motionary/") for path in found]
    assert names == ["a/one.json", "a/read.py", "a/tables", "stages/s.py"]
    before = code_hash(tmp_path, "s")
    (package / "a" / "tables" / "five.json").write_text("{}")
    assert code_hash(tmp_path, "s") != before
    read = ("motion/rigs.json", "motion/skeletons", "language/dictionary.json")
    assert {f"src/motionary/{name}" for name in read} <= set(stages(repository)["preprocess"]["deps"])


def test_code_of_the_models_that_a_stage_reads_counts_although_they_are_opened_by_name(repository):
    for name in ("retrieval", "evaluation"):
        deps = stages(repository)[name]["deps"]
        assert "models/evaluator" in deps
        assert "src/motionary/systems/judges/evaluator.py" in deps
    # Which system a stage evaluates is not known to the map: its code comes by the report of its stage.
    evaluated = stages(repository)["evaluation"]["deps"]
    assert {"models/${item}", "reports/${item}.json"} <= set(evaluated)
    params = yaml.safe_load((repository / "params.yaml").read_text())
    for system in params["evaluation"]["systems"]:
        assert stages(repository)[system]["metrics"] == [f"reports/{system}.json"]


def test_the_page_depends_on_every_report_that_it_shows(repository):
    shown = {path for name, stage in stages(repository).items() for path in stage.get("metrics", [])}
    shown -= {"reports/summary.json", "reports/retrieval.json", "reports/evaluation/${item}.json"}
    assert shown <= set(stages(repository)["report"]["deps"])


def test_what_is_called_infrastructure_exists(repository):
    for path in INFRASTRUCTURE:
        assert (repository / path).exists(), path


def test_models_folder_of_the_package_is_tracked(repository):
    rules = (repository / ".gitignore").read_text().splitlines()
    assert "/models/" in rules
    assert "/data/" in rules
    assert not {"models/", "data/", "models", "data"} & set(rules)


def test_large_outputs_are_linked_from_the_cache(repository):
    text = (repository / ".dvc" / "config").read_text()
    order = text.split("type = ")[1].splitlines()[0].strip('"').split(",")
    # Copies come last; reflink first would make DVC copy folders where the file system has none.
    assert order == ["hardlink", "symlink", "copy"]
