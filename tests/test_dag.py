"""The map: names run from end to end, code dependencies are the real imports."""

import importlib

import yaml

from motionary.training.dependencies import INFRASTRUCTURE, rewrite, stage_dependencies

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
        importlib.import_module(f"motionary.models.{name}")
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
    found = stage_dependencies(tmp_path, stage)
    names = [path.removeprefix("src/motionary/") for path in found]
    assert names == ["a/__init__.py", "a/more.py", "a/thing.py", "b.py", "c.py", "stages/s.py"]


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
