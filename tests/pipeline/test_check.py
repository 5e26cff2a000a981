"""A value that no stage could work with is said before any stage runs."""

import copy
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from motionary.errors import InputError
from motionary.pipeline.check import check
from motionary.pipeline.params import write_params

ROOT = Path(__file__).parents[2]
PARAMS = yaml.safe_load((ROOT / "params.yaml").read_text())


def leaves(values, prefix=""):
    """Dotted keys of every value."""
    for name, value in values.items():
        yield from leaves(value, f"{prefix}{name}.") if isinstance(value, dict) else [f"{prefix}{name}"]


# What conf/ derives from the registry is nobody's setting.
KEYS = tuple(key for key in leaves(PARAMS) if not key.startswith("opened."))
# Settings of which there must be some; any other number may be 0.
NEEDED = """
fps min_seconds max_seconds min_count clips window steps batch_size learning_rate log_every width
code_dim dilation text_width motion_width dim word_dim margin radius pose_frames num_layers dim_feedforward num_heads
offsets ensemble max_words max_tokens top_p gumbel_temperature sampled_share attention_width latent kernel
curriculum_start curriculum_add curriculum_patience held_out scored_clips content_dim style_dim repetitions contents
codes codebook_size
diversity_contents diversity_samples pose_step pool diversity_pairs multimodality_texts examples multimodality_samples
multimodality_pairs generation_repetitions prompt_samples samples locomotion_samples physics_motions upstream
generator_layers token_layers detail_layers iterations flow_steps num_quantizers
components head_width head_blocks head_draws
"""
LARGE = {"seed", "window", "validate_every", "log_every", "patience"}  # of which no number is too large


def value_of(key):
    value = PARAMS
    for name in key.split("."):
        value = value[name]
    return value


def said(key, value):
    """What the check says of the configuration with one value changed; "" where it takes it."""
    top, *names = key.split(".")
    values = {top: None, **copy.deepcopy(PARAMS)}  # first, to be found first
    section, path = values, [top, *names]
    for name in path[:-1]:
        section = section[name]
    section[path[-1]] = value
    try:
        check(values, ROOT)
    except InputError as error:
        return str(error)
    return ""


def refused(value):
    """The keys that the check refuses `value` for; each must be named, with the value and a rule."""
    found = {key: line for key in KEYS if (line := said(key, value))}
    assert [line for key, line in found.items() if not line.startswith(f"{key}: {value}: ")] == []
    return set(found)


@pytest.mark.parametrize(
    ("value", "right"),
    [
        (-1, {"tokenizer.codebook_start"}),
        (1e9, set()),
        ("x", {"data.name", "source.root", "scale", "motion2text.source"}),
        (None, set()),
    ],
)
def test_nonsense_is_refused_for_every_key(value, right):
    assert set(KEYS) - refused(value) == right


def test_zero_is_refused_where_something_is_needed():
    """And nowhere else, but where no number belongs: text, lists, switches."""
    needed = {key for key in KEYS if key.split(".")[-1] in NEEDED.split()}
    needed |= {
        "evaluator.temperature",
        "joint_evaluator.temperature",
        "joint_evaluator.rate",
        "text2token.temperature",
        "masked_generator.temperature",
        "masked_autoregression.temperature",
        "style_evaluator.scale",
    }
    needed |= {"text2token.guidance"}  # without text_dropout
    needed |= {"masked_generator.text_dropout", "masked_autoregression.text_dropout"}  # with guidance
    needed |= {"precision"}  # 32 is one of its names
    needed -= {"masked_generator.examples"}  # none are looked at
    numbers = {key for key in KEYS if isinstance(value_of(key), int | float) and not isinstance(value_of(key), bool)}
    assert refused(0) == needed | (set(KEYS) - numbers)


def test_no_number_is_without_a_limit():
    assert {key.split(".")[-1] for key in set(KEYS) - refused(10**9)} <= LARGE


def test_the_committed_configuration_and_every_scale_pass(repository, tmp_path):
    check(PARAMS, repository)
    for scale in ("small", "paper"):
        write_params(repository, tmp_path / "params.yaml", [f"scale={scale}"])
        check(yaml.safe_load((tmp_path / "params.yaml").read_text()), repository)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tokenizer": {"beta": 5}}, "tokenizer.beta: renamed: is called tokenizer.commitment_weight now"),
        ({"tokenizer": {"codez": 5}}, "tokenizer.codez: 5: unknown key"),
        (
            {"text2token": {"architecture": "transformer", "num_heads": 7}},
            "text2token.width: 256: must be divisible by",
        ),
        ({"text2token": {"architecture": "transformer"}}, "inverse_alignment: transformer: needs text2token.arch"),
        ({"stylization": {"settings": ["half"]}}, "stylization.settings: ['half']: must be a list of some of superv"),
        ({"evaluation": {"systems": ["tokenizer", "temos2"]}}, "evaluation.systems: temos2: must be one of "),
        ({"evaluation": {"multimodality_pairs": 11}}, "evaluation.multimodality_samples: 20: must be at least twice"),
        ({"data": {"source": "folder", "roots": ["nowhere"]}}, "data.roots: nowhere: no such folder"),
        ({"language": {"word_vectors": "glove.txt"}}, "language.word_vectors: glove.txt: must be one of auto, "),
        ({"tokenizer": None}, "tokenizer: None: must be a section of keys and values"),
        ({"evaluator": {"dropout": True}}, "evaluator.dropout: True: must be a number"),
        ({"motion2text": {"width": 128.5}}, "motion2text.width: 128.5: must be a whole number"),
        ({"evaluator": {"margin": float("nan")}}, "evaluator.margin: nan: must be a number"),
    ],
)
def test_what_a_value_must_be_is_said(changes, said):
    values = copy.deepcopy(PARAMS)
    for section, change in changes.items():
        values[section] = change if change is None else values[section] | change
    with pytest.raises(InputError) as caught:
        check(values, ROOT)
    assert str(caught.value).startswith(said)


def test_make_repro_says_it_before_anything_runs(repository, tmp_path):
    for name in ("dvc.yaml", "params.yaml"):
        shutil.copy(repository / name, tmp_path)
    text = (tmp_path / "params.yaml").read_text()
    (tmp_path / "params.yaml").write_text(text.replace("held_out: 0.2", "held_out: 0"))
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "motionary.pipeline.repro"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stderr == "error: styles.held_out: 0: must lie between 0 and 1\n"
    assert done.returncode == 2
    assert time.monotonic() - began < 30
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dvc.yaml", "params.yaml"]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("data.fps", 10**400),
        ("language.word_vectors", "x" * 1000),
        ("residual_tokenizer.levels", ""),
        ("residual_tokenizer.levels", 8),
        ("stylization.content_dim", {}),
        ("temos.language_model", "no/such-model"),
    ],
)
def test_a_value_of_another_kind_is_named(key, value):
    section, name = key.split(".")
    with pytest.raises(InputError) as caught:
        check({**PARAMS, section: {**PARAMS[section], name: value}}, ROOT)
    assert caught.value.what == key
