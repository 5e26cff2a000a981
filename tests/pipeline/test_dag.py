"""The map: names run from end to end, every stage hangs on its code and on all models that it opens."""

import re

import yaml

from motionary.pipeline.code import FOLDER, Code
from motionary.pipeline.dag import draw, layers, main, stage_graph
from motionary.study.experiments import paths_of, with_values
from motionary.systems.registry import find, judges
from motionary.systems.serving import filled, served_by

# Stages without a model of their own.
PLAIN = {"source", "preprocess", "evaluation", "style_evaluation", "action_evaluation", "report"}


def stages(repository):
    loaded = yaml.safe_load((repository / "dvc.yaml").read_text())["stages"]
    return {name: stage.get("do", stage) for name, stage in loaded.items() if name != "code"}


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
        draws = "stage.seed" in code or re.search(r"\btrain(_\w+)?\(", code) is not None
        own = "seed" in params.get(name, {})  # the judge's: systems of all seeds meet the same one
        assert own == (name in ("autoencoder", "evaluator", "joint_evaluator", "action_evaluator"))
        assert ("seed" in stage.get("params", [])) == (draws and not own), name


def test_every_stage_hangs_on_the_listing_of_its_code(repository):
    pipeline = yaml.safe_load((repository / "dvc.yaml").read_text())
    assert pipeline["stages"]["code"]["always_changed"]
    assert paths_of(pipeline["stages"]["code"], "outs") == [FOLDER]
    params = yaml.safe_load((repository / "params.yaml").read_text())
    params["source"]["roots"] = ["clips"]
    written, named = Code(repository).names(), set()
    for name, stage in with_values(pipeline, params)["stages"].items():
        if name == "code":
            continue
        (listing,) = (path for path in stage["deps"] if path.startswith(f"{FOLDER}/"))
        assert listing == f"{FOLDER}/{'source' if name == 'source@clips' else name}.txt"
        named.add(listing.removeprefix(f"{FOLDER}/").removesuffix(".txt"))
    assert named <= set(written)
    assert {name for name in written if "@" not in name} <= named


def test_an_evaluation_hangs_on_every_model_that_it_opens(repository):
    pipeline = yaml.safe_load((repository / "dvc.yaml").read_text())
    params = yaml.safe_load((repository / "params.yaml").read_text())
    found = with_values(pipeline, params)["stages"]
    for system in params["evaluation"]["systems"]:
        models = {path for path in found[f"evaluation@{system}"]["deps"] if path.startswith("models/")}
        assert models == {f"models/{name}" for name in served_by([system, "retrieval", *judges()])}
    assert "models/text2length" in found["evaluation@text2motion"]["deps"]
    assert "models/text2length" not in found["text2motion"]["deps"]  # it is trained without


def test_a_role_is_filled_as_the_configuration_says():
    sections = {"text2token": {"tokenizer": "residual"}, "other": {"tokenizer": "wrong"}}

    def section(name):
        return sections.get(name, {})

    assert filled("text2token", section) == {"tokenizer": "residual"}
    roles = filled("inverse_alignment", section)
    assert roles == {"text2token": "text2token", "motion2text": "motion2text", "tokenizer": "residual"}


def test_the_map_is_short(repository):
    assert len((repository / "dvc.yaml").read_text().splitlines()) <= 450  # 350 before TEMOS and action2motion moved in


def test_the_page_depends_on_every_report_that_it_shows(repository):
    outs = {path for stage in stages(repository).values() for path in stage.get("outs", [])}
    shown = {path for path in outs if re.fullmatch(r"reports/\w+\.json", path)}
    shown -= {"reports/summary.json", "reports/preferred.json", "reports/retrieval.json"}
    assert len(shown) > 20
    assert shown <= set(stages(repository)["report"]["deps"])


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


def test_the_picture_has_every_stage_behind_those_that_it_reads(repository):
    graph = stage_graph(repository)
    assert set(graph) == set(stages(repository)) - {"source"}  # of which there is one for each data root
    assert {("tokenizer", "text2token"), ("text2token", "inverse_alignment"), ("evaluation", "report")} <= set(
        graph.edges
    )
    assert ("tokenizer", "inverse_alignment") not in graph.edges  # it follows from the others
    column = {name: i for i, names in enumerate(layers(graph)) for name in names}
    assert all(column[before] < column[after] for before, after in graph.edges)
    figure = draw(graph, {"temos": "one latent, " * 9})
    words = [text.get_text() for text in figure.axes[0].texts]
    assert set(graph) <= set(words)
    assert max(map(len, words)) < 70


def test_a_picture_needs_a_pipeline(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["dag.png"]) == 2
    assert "no dvc.yaml" in capsys.readouterr().err
    assert main([]) == 2
