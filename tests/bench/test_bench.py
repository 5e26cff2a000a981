"""The benchmark lists and runs every case; what it counts is held against closed forms. No times are asserted."""

from __future__ import annotations

import dataclasses
import json
import re

import pytest
import torch

from motionary.bench import __main__ as bench
from motionary.bench import measure
from motionary.bench.cases import CASES
from motionary.bench.made import make_batch, make_context
from motionary.bench.measure import convolution_flops, cpu_time, least_time, peak_memory
from motionary.bench.shapes import SMALL, Shapes
from motionary.bench.workload import COPIES, PRODUCTS, Bound, Case, clock, training_step
from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

NAMES = [case.name for case in CASES]


def test_work_has_a_bound_in_units_of_a_yardstick():
    bounded = {case.name for case in CASES if case.bound is not None}
    assert set(NAMES) - bounded == {"recover", "autoencoder", "loading", "bvh", "bvh_long"}
    by_copies = {case.name for case in CASES if case.bound is not None and case.bound.unit == COPIES}
    assert by_copies == {"features", "stylize", "metrics", "mp4", "glb", "shell", "page", "first_frame"}
    assert all(0 < case.bound.amount < 2000 for case in CASES if case.bound is not None)
    assert len(set(NAMES)) == len(NAMES)


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
    assert result["rates"].keys() == {PRODUCTS, COPIES}
    assert all(rate > 0 for rate in result["rates"].values())
    assert (result["verdict"] is None) == (result["cost"] is None) == (case.bound is None)


def test_a_case_runs_in_a_process_of_its_own(capsys):
    assert bench.main(["--only", "features", "--small", "--repeats", "1", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    (found,) = printed["cases"]
    assert found["name"] == "features"
    assert found["bound"]["unit"] == COPIES
    assert found["cost"] == pytest.approx(found["seconds"] * found["rates"][COPIES])
    assert found["verdict"] in ("ok", "over")


def test_a_case_without_its_module_is_listed(monkeypatch):
    def prepare(shapes):
        raise ModuleNotFoundError("no such module", name="motionary.models.later")

    case = Case("later", "a later system", prepare, Bound(1.0))
    monkeypatch.setattr(bench, "CASES", (case,))
    found = bench.row(case, bench.measure("later", SMALL, 1))
    assert found["verdict"] == "absent"
    shown = bench.table([found])
    assert "a later system" in shown
    assert "needs motionary.models.later" in shown


def test_verdicts_and_table():
    def fail(shapes):
        pytest.fail("not run")

    product, copy = Case("x", "some work", fail, Bound(20.0)), Case("y", "other work", fail, Bound(1.0, COPIES))
    measured = {"runs": 3, "memory": 2**28, "rates": {PRODUCTS: 40.0, COPIES: 4.0}}
    rows = [
        bench.row(product, {**measured, "seconds": 0.5, "note": ""}),
        bench.row(product, {**measured, "seconds": 0.6, "note": "slow"}),
        bench.row(copy, {**measured, "seconds": 0.3, "note": "", "rates": {PRODUCTS: 50.0, COPIES: 2.0}}),
        bench.row(product, {"failed": "MemoryError"}),
    ]
    assert [found["verdict"] for found in rows] == ["ok", "over", "ok", "failed"]
    assert [found.get("cost") for found in rows] == [20.0, 24.0, pytest.approx(0.6), None]
    lines = bench.table(rows).splitlines()
    assert "256 MB" in lines[2]
    assert "24 GFLOP" in lines[3]
    assert "0.6 GB" in lines[4]
    assert len({line.rindex("B") for line in lines[2:5]}) == 1  # aligned
    assert lines[-4:-2] == ["  x: slow", "  x: MemoryError"]
    assert lines[-2:] == ["  memory copies: 2.0 to 4.0 GB/s", "  matrix products: 40.0 to 50.0 GFLOP/s"]


def test_nothing_is_compared_with_what_was_not_run():
    fields = {field.name for field in dataclasses.fields(Case)}
    assert fields == {"name", "title", "prepare", "bound"}
    rows = [bench.row(case, bench.measure(case.name, SMALL, repeats=1)) for case in CASES if case.name == "metrics"]
    shown = bench.table(rows)
    assert not {"ratio", "reference", "released"} & set(re.findall("[a-z]+", shown))


def test_yardsticks_take_turns_with_the_work(monkeypatch):
    clock, calls = [0.0], []
    monkeypatch.setattr(measure, "cpu_time", lambda: clock[0])
    yardsticks = measure.Yardsticks(rows=500, megabytes=2)

    def takes(name, seconds):
        def run():
            calls.append(name)
            clock[0] += seconds * (2 if len(calls) < 4 else 1)  # the machine is slow in the first turn

        return run

    yardsticks._run = {PRODUCTS: takes(PRODUCTS, 0.5), COPIES: takes(COPIES, 0.25)}
    timed = yardsticks.beside(takes("work", 3.0), repeats=2)
    assert calls == ["work", PRODUCTS, COPIES] * 2
    assert (timed.seconds, timed.runs) == (3.0, 2)
    assert timed.rates == {PRODUCTS: pytest.approx(0.25 / 0.5), COPIES: pytest.approx(2 * 2**20 / 1e9 / 0.25)}
    assert yardsticks.bytes == 3 * 500 * 500 * 4 + 2 * 2 * 2**20


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


@pytest.mark.parametrize(("precision", "product"), [("32", torch.float32), ("bf16-mixed", torch.bfloat16)])
def test_training_steps_have_the_precision_that_is_asked_for(precision, product):
    model, seen = torch.nn.Linear(3, 2), []

    def loss() -> torch.Tensor:
        out = model(torch.ones(4, 3))
        seen.append(out.dtype)
        return out.float().sum()

    training_step(dataclasses.replace(SMALL, precision=precision), model, loss)()
    assert seen == [product]
    assert model.weight.dtype == torch.float32
