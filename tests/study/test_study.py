"""The study: what its experiments override, what it skips and repeats, and what its tables say."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import time
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import psutil
import pytest
import yaml

from motionary.errors import InputError
from motionary.pipeline.code import code_hash
from motionary.study import __main__ as runner
from motionary.study.compare import comparisons, measured, measured_all, study_tables
from motionary.study.experiments import compose, read_pipeline, read_study, scoring_stage, sections_read, with_values

# The project's own study ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shipped(repository, tmp_path_factory):
    """conf/study.yaml on two empty roots."""
    roots = [tmp_path_factory.mktemp(name) for name in ("one", "two")]
    return read_study(repository, repository / "conf/study.yaml", [str(root) for root in roots])


def test_every_line_of_prose_reaches_its_entry_whole(repository, shipped):
    """YAML ends a text at " #" and takes the lines behind a list for its items, without a word."""
    text = (repository / "conf/study.yaml").read_text()
    written = [line.split("why:", 1)[1].strip() for line in text.splitlines() if line.lstrip().startswith("why:")]
    values = yaml.safe_load(text)
    assert set(values) == {"base", "roots", "experiments", "compare"}
    assert [entry.get("why") for entry in values["experiments"].values()] == written
    assert all(set(entry) <= {"why", "set", "vary", "times", "systems"} for entry in values["experiments"].values())
    assert all(len(why.split()) > 3 for why in written)
    assert all(len(side) == 2 for pair in values["compare"] for side in pair)
    assert all(len(pair) == 2 for pair in values["compare"])
    assert text.count("  - [[") == len(values["compare"]) == len(shipped.compare)


def of_entry(study, entry):
    return [e for e in study.experiments if e.entry == entry]


@pytest.fixture(scope="module")
def configured(repository):
    """The configuration of an experiment, by its overrides; composed once."""
    composed = cache(lambda overrides: compose(repository, overrides))
    return lambda experiment: composed(experiment.overrides)


def test_every_override_composes_and_changes_what_it_names(repository, shipped, configured):
    keys = {e.key for e in shipped.experiments}
    assert len(keys) == len(shipped.experiments), "two experiments compose to the same configuration"
    for experiment in shipped.experiments:
        config = configured(experiment)
        assert (config["data"]["name"], config["scale"]) == ("folder", "small")
        assert all(Path(root).is_absolute() for root in config["data"]["roots"])
        listed = {s for s in experiment.systems if scoring_stage(s) == f"evaluation@{s}"}
        assert listed <= set(config["evaluation"]["systems"])
        assert all((repository / "stages" / f"{s}.py").exists() for s in set(experiment.systems) - listed)
        json.dumps(config, allow_nan=False)


def test_what_a_paper_would_add_is_there(shipped, configured):
    def values(entry, key):
        configs = [configured(e) for e in of_entry(shipped, entry)]
        section, _, name = key.rpartition(".")
        return [config[section][name] if section else config[name] for config in configs]

    assert values("main", "seed") == [0, 1, 2]
    assert values("second_split", "data.seed") == [1]
    assert values("splits", "data.seed") == [0, 1, 2]
    assert values("combinations", "data.split") == ["combination"]
    assert values("transformer", "text2token.architecture") == ["transformer"] * 3
    for entry, frames in (("no_tokens", 1), ("no_tokens_units", 4)):
        assert values(entry, "motion2text.tokens") == [False] * 3
        assert values(entry, "motion2text.pose_frames") == [frames] * 3
    assert values("gradient_codebook", "tokenizer.quantizer") == ["gradient"]
    assert values("margin_evaluator", "evaluator.objective") == ["margin"]
    for switch in ("snippets", "attention", "tags", "positions"):  # the rows of the thesis's Table 4.4
        assert values(f"no_{switch}", f"text2motion.{switch}") == [False] * 3
        assert (("brief", "text2motion"), (f"no_{switch}", "text2motion")) in shipped.compare
    assert values("plain_latents", "latents.variant") == ["A"] * 3
    assert values("no_latents", "latents.variant") == ["none"] * 3
    for entry, weight in (("no_homo_style", "hsa"), ("no_cycle", "cycle")):  # the thesis's Table 5.6
        assert values(entry, "seed") == [0, 1, 2]
        for config in (configured(e)["stylization"] for e in of_entry(shipped, entry)):
            assert config["supervised"][weight] == config["unsupervised"][weight] == 0
    steps = values("main", "inverse_alignment.steps")
    for control, factor in (("control_updates", 1.0), ("control_time", 3.5)):
        assert values(control, "inverse_alignment.alignment") == [False] * 3
        assert values(control, "seed") == [0, 1, 2]
        assert values(control, "inverse_alignment.steps") == [round(factor * n) for n in steps]


def test_the_first_seed_of_everything_runs_before_the_second(shipped):
    names = [e.name for e in shipped.experiments]
    assert names.index("main-0") == 0
    assert names.index("margin_evaluator") < names.index("main-1") < names.index("control_time-1")
    assert names.index("no_tokens-1") < names.index("main-2")


def test_only_what_an_experiment_evaluates_is_run(repository, shipped):
    pipeline = with_values(read_pipeline(repository), compose(repository, []))
    needed = {e.entry: runner.needed_reports(pipeline, e.systems) for e in shipped.experiments}
    main = needed["main"]
    assert main.index("reports/preprocess.json") < main.index("reports/tokenizer.json")
    assert main.index("reports/text2token.json") < main.index("reports/inverse_alignment.json")
    assert {f"reports/evaluation/{s}.json" for s in ("motion2text", "text2token", "inverse_alignment")} < set(main)
    assert "reports/inverse_alignment.json" not in needed["transformer"]  # it needs the GRU
    assert "reports/inverse_alignment.json" not in needed["no_tokens"]  # its reader reads tokens
    assert "reports/tokenizer.json" not in needed["splits"]  # dear, and not needed
    assert needed["splits"][-1] == "reports/evaluation/autoencoder.json"
    assert needed["no_latents"][-1] == "reports/style_evaluation.json"
    assert "reports/latents.json" in needed["no_latents"]
    assert not any("tokenizer" in path or "reports/evaluation/" in path for path in needed["no_latents"])
    assert all(path.count("{") == 0 for paths in needed.values() for path in paths)


def test_dry_prints_commands_that_a_shell_reads_back(repository, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(repository)
    root = tmp_path / "my clips"
    root.mkdir()
    entry = {"set": ["inverse_alignment.alignment=false"], "times": {"inverse_alignment.steps": 0.5}}
    entry |= {"vary": {"seed": [3, 4]}, "systems": ["inverse_alignment"]}
    values = {"base": ["data=folder"], "roots": [], "experiments": {"short": entry}}
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(values))
    arguments = ["--dry", "--only", "short-4", "--roots", str(root), "--study", str(tmp_path / "study.yaml")]
    assert runner.main(arguments) == 0
    (line,) = capsys.readouterr().out.splitlines()
    words = shlex.split(line)
    assert words[:5] == ["dvc", "exp", "run", "--temp", "--name"]
    assert words[5].startswith("study-short-4-")
    assert [w for before, w in pairwise(words) if before == "--set-param"] == [
        "data=folder",
        f"data.roots=['{root}']",
        "inverse_alignment.alignment=false",
        "seed=4",
        f"inverse_alignment.steps={round(0.5 * compose(repository, [])['inverse_alignment']['steps'])}",
    ]
    assert words[-1] == "evaluation@inverse_alignment"
    assert runner.main([*arguments[:2], "tall", *arguments[3:]]) == 2
    assert "--only: tall: must be among short" in capsys.readouterr().err


def test_a_study_is_named_as_its_folder_of_results_may_be(repository, tmp_path):
    path = tmp_path / "evaluation.yaml"  # reports/evaluation/ holds other results
    path.write_text(yaml.safe_dump({"base": [], "experiments": {"a": {"systems": ["text2token"]}}}))
    with pytest.raises(InputError, match=r"NAME_study\.yaml"):
        read_study(repository, path)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"experiments": {"a": {"systems": ["text2token"], "set": ["tokenizer.codez=1"]}}}, "tokenizer.codez"),
        ({"experiments": {"a": {"systems": [], "set": []}}}, "a.systems"),
        ({"experiments": {"a": {"systems": ["text2token"], "sets": []}}}, "sets"),
        ({"experiments": {"a": {"systems": ["text2token"], "times": {"seeds": 2}}}}, "times"),
        ({"compare": [[["a", "text2token"], ["b", "text2token"]]]}, "compare"),
        ({"compare": [[["a", "text2token"]]]}, "compare"),
        ({"compare": ["and so on"]}, "compare"),
        ({"experiments": {"a": {"systems": ["text2token"], "why": {"Table 4.4": "no tags"}}}}, "a.why"),
        ({"roots": ["not/here"]}, "roots"),
        ({"base": None}, "study.yaml"),
    ],
)
def test_a_wrong_study_is_one_line(repository, tmp_path, change, named):
    plain = {"base": [], "roots": [], "experiments": {"a": {"systems": ["text2token"]}}, "compare": []}
    path = tmp_path / "study.yaml"
    path.write_text(yaml.safe_dump({**plain, **change}))
    with pytest.raises(InputError, match=named) as error:
        read_study(repository, path)
    assert "\n" not in str(error.value)


# State and tables, from made-up reports ---------------------------------------------------------------------------


def made_up(reports: Path, experiment, shift: float) -> None:
    """Reports as the stages write them, with the few numbers that the tables show."""
    part = {"r1": {"mean": 0.5 + shift, "half": 0.01}, "r3": {"mean": 0.9 + shift}, "fid": {"mean": 1.0 - shift}}
    files = {"tokenizer.json": {"positions": {"all": {"local_mm": 40.0}}, "codes": {"used": 0.9}}}
    for system in experiment.systems:
        report = {"real": {"all": {"r1": {"mean": 0.8}, "r3": {"mean": 0.99}}, "captioned": {"r3": {"mean": 0.6}}}}
        if system == "motion2text":
            report["language"] = {"all": {"bleu4": 0.7 + shift, "raw": {"bleu4": 0.4}}, "captioned": {"bleu4": 0.5}}
        else:
            report |= {"generation": {"all": part, "captioned": part}, "oracle": {"prompts": {"confirmed": 0.6}}}
            if system == "text2motion":
                report["real_lengths"] = {"generation": {"all": {"r3": {"mean": 0.95 + shift}}}}
            files[f"{system}.json"] = {"training": {"validation_caption_nll": 2.0 - shift}}
        files[f"evaluation/{system}.json"] = report
    for name, content in files.items():
        (reports / name).parent.mkdir(parents=True, exist_ok=True)
        (reports / name).write_text(json.dumps(content))


def fill(root: Path, experiment, shift: float) -> None:
    source = root / "source" / experiment.name
    made_up(source / "reports", experiment, shift)
    paths = [p.relative_to(source).as_posix() for p in source.rglob("*.json")]
    runner.collect(root, experiment, paths, lambda path: (source / path).read_text())


def test_done_means_the_same_configuration(shipped, tmp_path):
    first, second = of_entry(shipped, "main")[:2]
    assert not runner.is_done(tmp_path, first)
    fill(tmp_path, first, 0.0)
    assert runner.is_done(tmp_path, first)
    assert not runner.is_done(tmp_path, second)
    (tmp_path / second.folder).mkdir()
    assert not runner.is_done(tmp_path, second), "a folder without a record is a killed one"
    assert not runner.is_done(tmp_path, replace(first, key=second.key)), "another configuration, other results"


def test_runs_of_other_code_are_named(shipped, tmp_path):
    code = tmp_path / "stages" / "tokenizer.py"
    code.parent.mkdir()
    code.write_text("first = 1\n")
    first, second = of_entry(shipped, "main")[:2]
    for experiment in (first, second):
        fill(tmp_path, experiment, 0.0)
    report = tmp_path / second.folder / "tokenizer.json"
    report.write_text(json.dumps({"codes": {"used": 1.0}, "code": code_hash(tmp_path, "tokenizer")}))
    assert "other code" not in runner.write_results(tmp_path, shipped)
    code.write_text("second = 2\n")
    text = runner.write_results(tmp_path, shipped)
    assert f"Run with other code than the present (--again runs them anew): main ({second.value}).\n" in text


def test_results_hang_on_what_their_stages_read(repository):
    pipeline = with_values(read_pipeline(repository), compose(repository, []))
    judges = ["language", "autoencoder", "evaluator", "joint_evaluator", "retrieval"]
    assert sections_read(pipeline, ["motion2text"]) == sorted(
        ["data", *judges, "tokenizer", "motion2text", "evaluation", "seed"]
    )
    by_vae = set(sections_read(pipeline, ["text2motion"]))
    assert {"text2motion", "text2length", "autoencoder", "evaluator", "data"} <= by_vae
    assert not by_vae & {"tokenizer", "motion2text", "stylization", "source", "device"}
    assert not set(sections_read(pipeline, ["style_evaluation"])) & {"evaluator", "tokenizer"}
    both = sections_read(pipeline, ["motion2text", "text2motion"])
    assert both == sorted(by_vae | set(sections_read(pipeline, ["motion2text"])))


def test_nothing_half_collected_stays(shipped, tmp_path):
    experiment = shipped.experiments[0]

    def read(path):
        if path.endswith("tokenizer.json"):
            raise KeyboardInterrupt
        return "{}"

    with pytest.raises(KeyboardInterrupt):
        runner.collect(tmp_path, experiment, ["reports/preprocess.json", "reports/tokenizer.json"], read)
    assert not runner.is_done(tmp_path, experiment)
    assert not (tmp_path / experiment.folder).exists()


def test_differences_are_paired_by_seed(shipped, tmp_path):
    # Inverse alignment gains 0.02, 0.03 and 0.04 over its control, on seeds that differ more than that.
    for experiment, shift in zip(of_entry(shipped, "main"), (0.02, -0.07, 0.09), strict=True):
        fill(tmp_path, experiment, shift)
    for experiment, shift in zip(of_entry(shipped, "control_time"), (0.0, -0.10, 0.05), strict=True):
        fill(tmp_path, experiment, shift)
    fill(tmp_path, of_entry(shipped, "control_updates")[1], -0.09)

    text = runner.write_results(tmp_path, shipped)
    summary = json.loads((tmp_path / shipped.folder / "study.json").read_text())
    found = {(r["minus"], r["metric"]): r for r in summary["differences"] if r["of"] == "main inverse_alignment"}
    gain = found["control_time inverse_alignment", "R@3"]
    assert gain["pairs"] == 3
    assert gain["mean"] == pytest.approx(0.03)
    assert gain["half"] == pytest.approx(4.3027 * 0.01 / 3**0.5, rel=1e-4)  # Student's t, 2 degrees of freedom
    assert found["control_time inverse_alignment", "Caption NLL"]["mean"] == pytest.approx(-0.03)
    alone = found["control_updates inverse_alignment", "R@1"]
    assert (alone["pairs"], alone["half"]) == (1, None)
    assert alone["mean"] == pytest.approx(0.02)

    assert (tmp_path / shipped.folder / "table.md").read_text() == text
    assert "| main inverse_alignment - control_time inverse_alignment | 3 |" in text
    assert "0.030 ± 0.025" in text
    assert "| control_updates: inverse_alignment | 1 | 0.410 ± 0.010 |" in text  # alone: the evaluation's own interval
    assert "| main: inverse_alignment | 0, 1, 2 |" in text
    assert "BLEU-4, captioned" in text
    assert "transformer-0" in summary["missing"]
    assert "Not run yet: control_updates (0, 2), transformer (0, 1, 2), " in text
    assert "main-0" not in summary["missing"]


def test_ablations_are_compared_with_the_full_system_of_their_seed_at_both_lengths(shipped, tmp_path):
    for experiment, shift in zip(of_entry(shipped, "brief"), (0.02, 0.03, 0.04), strict=True):
        fill(tmp_path, experiment, shift)
    for experiment, shift in zip(of_entry(shipped, "no_attention"), (0.0, 0.0, 0.0), strict=True):
        fill(tmp_path, experiment, shift)
    text = runner.write_results(tmp_path, shipped)
    summary = json.loads((tmp_path / shipped.folder / "study.json").read_text())
    found = {r["metric"]: r for r in summary["differences"] if r["minus"] == "no_attention text2motion"}
    for metric in ("R@3", "Real lengths R@3"):
        assert found[metric]["mean"] == pytest.approx(0.03)
        assert found[metric]["half"] == pytest.approx(4.3027 * 0.01 / 3**0.5, rel=1e-4)
    assert "| no_attention: text2motion | 0, 1, 2 |" in text
    assert "Real lengths R@3" in text


def test_stylization_is_measured_by_its_own_stage(shipped, tmp_path):
    values = {"style_accuracy": {"mean": 0.8, "half": 0.1}, "geodesic": {"mean": 0.3, "half": 0.1}}
    rows = {"style_transfer": {"held-out combinations": {"rows": {"label-based (S)": values}}}}
    runs = {}
    for experiment in [*of_entry(shipped, "stylization"), *of_entry(shipped, "no_latents")]:
        folder = tmp_path / experiment.name
        folder.mkdir()
        values["style_accuracy"]["mean"] = 0.8 - 0.3 * (experiment.entry == "no_latents")
        (folder / "style_evaluation.json").write_text(json.dumps(rows))
        runs[experiment.name] = {"style_evaluation": measured(folder, "style_evaluation")}
    found = comparisons(shipped, runs)
    means, differences = study_tables(shipped, runs, found)
    assert means.title == "Stylization of held-out combinations"
    assert [(*row[:2], row[2][:5]) for row in means.rows] == [
        ("stylization: style_evaluation", "0, 1, 2", "0.800"),
        ("no_latents: style_evaluation", "0, 1, 2", "0.500"),
    ]
    assert differences.rows[0][0] == "stylization style_evaluation - no_latents style_evaluation"
    assert differences.rows[0][2].startswith("0.300")


def test_the_study_of_cmu_has_one_judge_for_all_seeds_and_no_sentence_that_may_not_be_passed_on(repository):
    study = read_study(repository, repository / "conf/cmu_study.yaml")
    configs = [compose(repository, e.overrides) for e in study.experiments]
    assert [config["seed"] for config in configs] == [0, 0, 0, 0, 0, 0, 1, 1, 2, 2]
    for config, experiment in zip(configs, study.experiments, strict=True):
        assert config["evaluator"]["seed"] == config["joint_evaluator"]["seed"] - 1 == 0
        assert config["data"]["source_weights"]["kit-ml"] == 0
        assert set(experiment.systems) <= set(config["evaluation"]["systems"])


def test_the_study_of_masked_autoregression_has_one_judge_for_all_seeds(repository, tmp_path):
    study = read_study(repository, repository / "conf/masked_study.yaml", [str(tmp_path)])
    configs = [compose(repository, e.overrides) for e in study.experiments]
    assert [config["seed"] for config in configs] == [0, 1, 2]
    for config in configs:
        assert config["evaluator"]["seed"] == config["joint_evaluator"]["seed"] - 1 == 0


def test_the_second_judge_and_the_feet_stand_beside_the_first_judge(tmp_path):
    by = {"by": {"joint_evaluator": {"r3": {"mean": 0.4}, "fid": {"mean": 7.0}}}}
    report = {
        "generation": {"all": {"r3": {"mean": 0.5}, "fid": {"mean": 9.0}, **by}, "captioned": {"r3": {"mean": 0.3}}},
        "real": {"all": {"r3": {"mean": 0.6}, "by": {"joint_evaluator": {"r3": {"mean": 0.7}}}}},
        "physics": {"generated": {"foot_skating": 0.2}},
        "planted": {"physics": {"generated": {"foot_skating": 0.1}}},
    }
    own = {"positions": {"all": {"local_mm": 33.0}}, "codes": {"used": 0.9}}
    for path, content in {"evaluation/residual_tokenizer.json": report, "residual_tokenizer.json": own}.items():
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(json.dumps(content))
    found = {name: measure.mean for name, measure in measured(tmp_path, "residual_tokenizer").items()}
    assert found == {
        "R@3": 0.5, "R@3, captioned": 0.3, "R@3 by the second judge": 0.4, "FID": 9.0, "FID by the second judge": 7.0,
        "Real R@3": 0.6, "Real R@3 by the second judge": 0.7, "Feet sliding (m/s)": 0.2,
        "Feet sliding, planted (m/s)": 0.1, "Local MPJPE (mm)": 33.0, "Codes used": 0.9,
    }  # fmt: skip


def test_motions_of_actions_are_compared_row_by_row(repository, tmp_path, monkeypatch):
    monkeypatch.setattr("motionary.study.experiments._roots_override", lambda root, roots: [])
    study = read_study(repository, repository / "conf/action_study.yaml")
    assert len(study.experiments) == 6
    assert [e.name for e in study.experiments[:2]] == ["cmu_actions-0", "styled-0"]
    assert len({e.key for e in study.experiments}) == 6
    assert all(e.folder.parent == study.folder == Path("reports/action_study") for e in study.experiments)
    configs = {e.name: compose(repository, e.overrides) for e in study.experiments}
    assert {c["action_evaluator"]["seed"] for c in configs.values()} == {0}, "one judge for all seeds"
    assert {tuple(Path(root).name for root in c["data"]["roots"]) for c in configs.values()} == {
        ("cmu_actions",),
        ("styled",),
    }
    for experiment, shift in zip(of_entry(study, "cmu_actions"), (0.1, 0.2, 0.3), strict=True):
        rows = {"plain": {"fid": {"mean": 5.0 + shift}}, "lie": {"fid": {"mean": 5.0}, "accuracy": {"mean": 0.5}}}
        found = {"coarse": {"rows": rows}, "physics": {"plain": {"foot_skating": 0.4}}}
        (tmp_path / experiment.name).mkdir()
        (tmp_path / experiment.name / "action_evaluation.json").write_text(json.dumps({"action_generation": found}))
    done = of_entry(study, "cmu_actions")
    runs = {e.name: measured_all(tmp_path / e.name, e.systems) for e in done}
    differences = comparisons(study, runs)
    assert [(r["of"], r["minus"]) for r in differences] == [
        ("cmu_actions action_evaluation/plain", "cmu_actions action_evaluation/lie")
    ]
    assert (differences[0]["metric"], differences[0]["pairs"]) == ("FID of actions", 3)
    assert differences[0]["mean"] == pytest.approx(0.2)
    assert differences[0]["half"] == pytest.approx(4.3027 * 0.1 / 3**0.5, rel=1e-4)
    means, paired = study_tables(study, runs, differences)
    assert (means.title, paired.title) == ("Motions of actions", "Paired differences of actions")
    assert means.columns[2:] == ["FID of actions", "Accuracy", "Foot skating (m/s)"]
    assert [row[0] for row in means.rows] == [f"cmu_actions: action_evaluation/{name}" for name in ("plain", "lie")]
    assert means.rows[0][2].startswith("5.200 ± 0.248")


def test_measured_leaves_out_what_is_not_there(shipped, tmp_path):
    experiment = of_entry(shipped, "main")[0]
    fill(tmp_path, experiment, 0.0)
    folder = tmp_path / experiment.folder
    values = measured(folder, "motion2text")
    assert values["BLEU-4"].mean == 0.7
    assert values["BLEU-4, captioned"].mean == 0.5
    assert values["Real R@3, captioned"].mean == 0.6
    assert not {"R@1", "Oracle", "Caption NLL"} & set(values)
    assert measured(tmp_path, "motion2text") == {}
    assert study_tables(shipped, {}, comparisons(shipped, {})) == []


# DVC itself, on a pipeline of two stages that take no time --------------------------------------------------------

WORK = """
import json, os, pathlib, sys, yaml
stage, params = sys.argv[1], yaml.safe_load(open("params.yaml"))
with open(os.environ["STUDY_LOG"], "a") as log:
    log.write(stage + "\\n")
if params["tokenizer"]["width"] == 13 and stage != "tokenizer" and not os.path.exists(os.environ["STUDY_LOG"] + ".ok"):
    sys.exit("killed")
if stage == "tokenizer":
    pathlib.Path("models/tokenizer").mkdir(parents=True)
    pathlib.Path("models/tokenizer/weights").write_text(str(params["tokenizer"]["width"]))
    report, path = {"codes": {"used": 1.0}}, "reports/tokenizer.json"
else:
    width = int(pathlib.Path("models/tokenizer/weights").read_text())
    share = width / 100 + params["seed"] / 1000
    report = {"generation": {"all": {"r1": {"mean": share}, "r3": {"mean": 2 * share}}}}
    path = f"reports/evaluation/{stage}.json"
path = pathlib.Path(path)
path.parent.mkdir(parents=True, exist_ok=True)
path.write_text(json.dumps(report))
"""
CONFIG = """
defaults: [_self_]
seed: 0
data: {roots: []}
tokenizer: {width: 10}
evaluation: {systems: [text2token]}
"""
PIPELINE = """
stages:
  tokenizer:
    cmd: python work.py tokenizer
    params: [tokenizer]
    deps: [work.py]
    outs: [models/tokenizer, reports/tokenizer.json]
  evaluation:
    foreach: ${evaluation.systems}
    do:
      cmd: python work.py ${item}
      params: [evaluation, seed]
      deps: [work.py, models/tokenizer]
      outs: ["reports/evaluation/${item}.json"]
"""
STUDY = """
base: []
roots: []
experiments:
  main: {vary: {seed: [1, 2]}, systems: [text2token]}
  wide: {set: [tokenizer.width=13], vary: {seed: [1, 2]}, systems: [text2token]}
compare:
  - [[wide, text2token], [main, text2token]]
"""


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A small repository under Git and DVC, the current folder."""
    root = tmp_path / "project"
    (root / "conf").mkdir(parents=True)
    files = {"conf/config.yaml": CONFIG, "conf/study.yaml": STUDY, "dvc.yaml": PIPELINE, "work.py": WORK}
    files[".gitignore"] = "/models/\n/reports/\n"
    for name, content in files.items():
        (root / name).write_text(content)
    (root / "params.yaml").write_text(yaml.safe_dump(yaml.safe_load(CONFIG.replace("defaults: [_self_]", ""))))
    monkeypatch.chdir(root)
    monkeypatch.setenv("STUDY_LOG", str(tmp_path / "log"))
    for name in ("GIT_AUTHOR", "GIT_COMMITTER"):
        monkeypatch.setenv(f"{name}_NAME", "Test")
        monkeypatch.setenv(f"{name}_EMAIL", "test@example.org")

    def run(*command):
        subprocess.run(command, check=True, capture_output=True)

    run("git", "init", "-q")
    run(sys.executable, "-m", "dvc", "init", "-q")
    (root / ".dvc" / "config").write_text("[hydra]\n    enabled = true\n[core]\n    analytics = false\n")
    run("git", "add", "-A")
    run("git", "commit", "-qm", "start")
    return root


def test_a_study_goes_on_where_it_stopped(project, capfd):
    log = Path(os.environ["STUDY_LOG"])
    assert runner.main([]) == 1  # the wide ones are killed after their first stage
    printed = capfd.readouterr()
    assert "error: wide-1: dvc failed" in printed.err
    # Both seeds of main share one tokenizer, through the run cache.
    assert log.read_text().split() == ["tokenizer", "text2token", "tokenizer", "text2token", "text2token", "text2token"]
    log.unlink()
    Path(f"{log}.ok").touch()

    assert runner.main([]) == 0
    printed = capfd.readouterr().out
    assert printed.count("done before") == 2
    assert log.read_text().split() == ["text2token", "text2token"]  # the wide tokenizer was finished before
    found = json.loads((project / "reports/study/study.json").read_text())
    row = next(r for r in found["differences"] if r["metric"] == "R@3")
    assert (row["pairs"], row["mean"]) == (2, pytest.approx(0.06))
    assert found["missing"] == []
    status = subprocess.run(["git", "status", "--porcelain"], capture_output=True, text=True, check=True)
    assert status.stdout == "", "the workspace stays as it was"
    assert not (project / "models").exists()

    log.unlink()
    assert runner.main(["--again", "--only", "main-2"]) == 0  # asked for, but DVC knows it all
    assert not log.exists()


ENDLESS = """
import os, pathlib, sys, time
pathlib.Path(sys.argv[1]).write_text(str(os.getpid()))
time.sleep(600)
"""
ASKS = """
import os, pathlib, sys
from motionary.study.__main__ import guarded
guarded([sys.executable, "-c", sys.argv[1], sys.argv[2]], pathlib.Path.cwd(), os.environ)
"""


def test_a_killed_study_leaves_no_experiment_behind(tmp_path):
    file = tmp_path / "pid"
    study = subprocess.Popen([sys.executable, "-c", ASKS, ENDLESS, str(file)])
    try:
        assert until(lambda: file.exists() and file.read_text())
        pid = int(file.read_text())
        assert is_alive(pid)
    finally:
        study.kill()
        study.wait()
    assert until(lambda: not is_alive(pid))


def until(condition, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not (found := condition()) and time.monotonic() < deadline:
        time.sleep(0.05)
    return found


def is_alive(pid):
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:  # it may end between two looks
        return False


def test_a_new_system_leaves_old_results_valid(repository, tmp_path):
    """What else could be scored is no part of a key; how systems are scored is."""
    keys = {}
    for name, more in {"all": [], "one": ["evaluation.systems=[retrieval]"], "brief": ["evaluation.pool=4"]}.items():
        entry = {"base": [], "roots": [], "experiments": {"copied": {"set": more, "systems": ["retrieval"]}}}
        (tmp_path / f"{name}_study.yaml").write_text(json.dumps(entry))
        (experiment,) = read_study(repository, tmp_path / f"{name}_study.yaml").experiments
        keys[name] = experiment.key
    assert keys["all"] == keys["one"] != keys["brief"]
