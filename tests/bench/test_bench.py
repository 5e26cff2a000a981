"""The benchmark lists and runs every case; what it counts is held against closed forms. No times are asserted."""

from __future__ import annotations

import json

import pytest
import torch

from motionary.bench import __main__ as bench
from motionary.bench.cases import CASES
from motionary.bench.made import make_batch, make_context
from motionary.bench.measure import convolution_flops, cpu_time, least_time, peak_memory
from motionary.bench.shapes import SMALL, Shapes
from motionary.bench.workload import Case, clock
from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

NAMES = [case.name for case in CASES]


def test_every_figure_of_the_issue_has_a_case():
    bounds = {case.name: case.bound for case in CASES if case.bound is not None}
    assert bounds == {
        "features": 0.006, "tokenizer": 14.7, "motion2text": 6.0, "captions": 3.0, "text2token": 7.0,
        "inverse_alignment": 12.0, "texts": 15.0, "metrics": 0.15, "evaluator": 1.8, "text2length": 0.3,
        "text2motion": 7.5, "prompts": 1.5, "temos": 6.0, "temos_texts": 0.5,
        "masked_plan": 0.5, "masked_text": 0.15, "masked_texts": 2.5,
        "stylization": 5.0, "stylize": 0.02, "stylize32": 0.4,
        "action2motion": 1.5, "actions": 0.15,
        "mp4": 5.0, "glb": 0.3, "shell": 25.0, "page": 5.0, "first_frame": 2.0,
    }  # fmt: skip
    assert len(set(NAMES)) == len(NAMES)
    assert {"autoencoder", "bvh"} < set(NAMES)


def test_shapes_are_those_of_the_papers():
    paper = Shapes()
    assert (paper.windows, paper.window, paper.width, paper.codes) == (128, 64, 1024, 1024)
    assert (paper.batch, paper.source, paper.words, paper.unrolled) == (64, 55, 21, 54)
    assert (paper.sequences, paper.snippets, paper.prompts, paper.pairs) == (32, 50, 32, 32)
    assert (paper.style_window, paper.style_width) == (160, 512)
    assert (paper.captions, paper.caption_words, paper.texts, paper.items) == (32, 30, 300, 4000)


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_case_runs(case: Case):
    threads = torch.get_num_threads()
    result = bench.row(case, bench.measure(case.name, SMALL, repeats=1))
    torch.set_num_threads(threads)
    assert result["seconds"] > 0
    assert result["runs"] >= 1
    assert 10e6 < result["memory"] < 100e9
    assert (result["ratio"] is None) == (case.reference is None)
    assert (result["verdict"] is None) == (case.bound is None)


def test_a_case_runs_in_a_process_of_its_own(capsys):
    assert bench.main(["--only", "features", "--small", "--repeats", "1", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    (found,) = printed["cases"]
    assert (found["name"], found["reference"], found["bound"]) == ("features", 0.042, 0.006)
    assert found["verdict"] in ("ok", "over")
    assert printed["matmul_flops_per_second"] > 1e6


def test_a_case_without_its_module_is_listed(monkeypatch):
    def prepare(shapes):
        raise ModuleNotFoundError("no such module", name="motionary.models.later")

    case = Case("later", "a later system", prepare, reference=1.0, bound=1.0)
    monkeypatch.setattr(bench, "CASES", (case,))
    found = bench.row(case, bench.measure("later", SMALL, 1))
    assert found["verdict"] == "absent"
    shown = bench.table([found], rate=None)
    assert "a later system" in shown
    assert "needs motionary.models.later" in shown


def test_verdicts_and_table():
    case = Case("x", "some work", lambda shapes: pytest.fail("not run"), reference=2.0, bound=1.0)
    rows = [
        bench.row(case, {"seconds": 0.5, "runs": 3, "memory": 2**28, "note": ""}),
        bench.row(case, {"seconds": 1.5, "runs": 3, "memory": 2**28, "note": "slow"}),
        bench.row(case, {"failed": "MemoryError"}),
    ]
    assert [found["verdict"] for found in rows] == ["ok", "over", "failed"]
    assert rows[0]["ratio"] == 0.25
    lines = bench.table(rows, rate=5e10).splitlines()
    assert "50.0 GFLOP/s" in lines[0]
    assert "256 MB" in lines[2]
    assert len({line.rindex("B") for line in lines[2:4]}) == 1  # aligned
    assert lines[-2:] == ["  x: slow", "  x: MemoryError"]


def test_unknown_case_is_one_line(capsys):
    assert bench.main(["--only", "nonsense"]) == 2
    assert capsys.readouterr().err.startswith("error: --only: nonsense: must be among features, ")


@pytest.mark.parametrize("blocks", [(1, 3, 1), (2, 2, 0)])
def test_convolution_flops_closed_form(blocks):
    encoder, decoder, fine = blocks
    width, entry, frames, features = 12, 8, 16, 263
    config = TokenizerConfig(
        codebook_size=4, code_dim=entry, width=width, fine_width=0, encoder_blocks=encoder, decoder_blocks=decoder,
        fine_blocks=fine, quantizer="gradient", codebook_start=-1,
    )  # fmt: skip
    model = Tokenizer(config, make_context(SMALL)).train()
    batch = make_batch(2, frames)
    half, quarter = frames // 2, frames // 4
    block = 2 * 3 * width * width
    once = (
        half * fine * block
        + quarter * (4 * width * width + encoder * block + width * entry)
        + quarter * (entry * width + decoder * block)
        + half * 3 * width * width
        + frames * 3 * (width * features + features * features)
    )
    first = half * 4 * width * (features - 4)  # its input is data: no gradient for that
    expected = 2 * 2 * (3 * once + 2 * first)
    assert convolution_flops(model, lambda: model.loss(batch, 0.5, torch.Generator())) == expected


def test_convolution_flops_agree_with_torch():
    from torch.utils.flop_counter import FlopCounterMode

    layer = torch.nn.Sequential(torch.nn.Conv1d(5, 7, 3, stride=2), torch.nn.Conv1d(7, 6, 4, padding=2))
    x = torch.randn(3, 5, 21)
    with FlopCounterMode(display=False) as counter:
        layer(x).sum().backward()
    assert convolution_flops(layer, lambda: layer(x)) == counter.get_total_flops()


def test_measuring():
    seconds, runs = least_time(lambda: sum(range(1000)), repeats=2)
    assert seconds >= 0
    assert runs == 20
    assert cpu_time() > 0
    held = bytearray(b"x" * 50_000_000)
    assert peak_memory() >= len(held)


def test_clock():
    assert [clock(s) for s in (0.00523, 0.85, 14.68)] == ["5.2 ms", "0.85 s", "14.7 s"]
