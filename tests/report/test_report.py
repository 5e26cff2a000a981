"""The page and the tables, from reports made by the evaluation's own functions."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.evaluation.scores import Protocol, judged_parts
from motionary.motion import Motion, Skeleton
from motionary.report import caption_tables, summary, tables
from motionary.report.document import render
from motionary.report.headline import headline, systems_html
from motionary.report.physics_tables import physics_tables
from motionary.report.players import Example, motions_html
from motionary.report.results import Results
from motionary.report.table import Table, show
from motionary.report.verdicts import preferred, verdicts_table

PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b550000000a49444154789c6360000000020001"
    "48afa4710000000049454e44ae426082"
)
CHANCE = "other real motions, drawn"
PARTS = {"all": np.arange(40), "styled": np.arange(30), "captioned": np.arange(30, 40)}


def judged(noise: float, seed: int = 0):
    rng = np.random.default_rng(seed)
    text = rng.normal(size=(40, 8))
    motion = text + noise * rng.normal(size=text.shape)
    return judged_parts([(text, motion, PARTS)], text, Protocol(repetitions=3))


def generator_report(noise: float) -> dict:
    share = {"confirmed": 0.75, "checked": 20}
    return {
        "system": "x",
        "judge": "abc123",
        "generation": judged(noise),
        "real": judged(0.1),
        "physics": {"generated": {"foot_skating": 0.07}, "real": {"foot_skating": 0.03}},
        "oracle": {
            "captions": {"all": share, "styled": share},
            "captions_real": {"all": {"confirmed": 0.95, "checked": 20}},
            "captions_chance": {"all": {"confirmed": 0.0, "checked": 20}},
            "prompts": {"confirmed": 0.6, "samples": 10, "each": {"a person walks <fast>": 0.6}},
        },
        "multimodality": {"mean": 2.0, "half": 0.1, "texts": 4, "samples": 20},
        "nearest_training": {"generated": {"mean": 1.0, "least": 0.5}, "real": {"mean": 1.5, "least": 0.25}},
    }


def captioner_report() -> dict:
    words = {"items": 40, "bleu1": 0.8, "bleu4": {"mean": 0.6, "half": 0.04}, "rouge_l": 0.7, "cider": 3.0}
    words |= {"bert_score": 0.9, "bert_model": "small", "raw": {"bleu4": 0.4}}
    return {
        "system": "y",
        "judge": "abc123",
        "language": {"all": words, "styled": words},
        "captioning": judged(0.5),
        "real": judged(0.1),
        "action": {"all": {"named": 0.8, "checked": 30}},
        "examples": [{"caption": "a <b> walk", "references": ["A person walks.", "walking"]}],
    }


@pytest.fixture
def reports(tmp_path):
    folder = tmp_path / "reports"
    for name in ("evaluation", "figures/tokenizer"):
        (folder / name).mkdir(parents=True)
    positions = {"all": {"windows": 9, "local_mm": 31.24, "root_mm": 40.0, "global_mm": 200.0}}
    files = {
        "evaluation/alpha.json": generator_report(0.5),
        "evaluation/beta.json": generator_report(3.0) | {"caption_real": judged(0.1)} | {
            k: v for k, v in captioner_report().items() if k != "real"
        },
        "evaluation/gamma.json": captioner_report(),
        "tokenizer.json": {
            "positions": positions,
            "codes": {"used": 0.9, "perplexity": 70.0, "count": 128},
            "training": {"steps": 10, "best_step": 8, "best_validation_loss": 0.12345},
        },
        "preprocess.json": {
            "name": "demo", "read": 12, "kept": 10, "minutes_read": 3.5, "captions": 30, "dropped": {"too short": 2},
            "splits": {"train": {"windows": 8, "captioned": 8, "mirrored": 4, "minutes": 2.5}, "val": {}},
            "roots": {"demo": {"windows": 10, "captioned": 10, "mirrored": 4, "minutes": 3.1}},
            "problem_count": 1, "problems": [{"file": "a.bvh", "value": "0 bytes", "rule": "the file is empty"}],
        },
        "summary.json": {"never": "read"},
    }  # fmt: skip
    for name, values in files.items():
        (folder / name).write_text(json.dumps(values))
    for name in ("curves", "contexts"):
        (folder / "figures/tokenizer" / f"{name}.png").write_bytes(PIXEL)
    return folder


class Page(HTMLParser):
    """Open tags, texts and addresses of a page."""

    def __init__(self, html: str):
        super().__init__()
        self.open, self.texts, self.addresses, self.anchors, self.rows = [], [], [], set(), []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.addresses += [values[key] for key in ("src", "href") if key in values]
        self.anchors |= {values["id"]} if "id" in values else set()
        if tag not in ("meta", "img", "input", "option", "link", "br"):
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag):
        if tag != "option":
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)
        if self.open[-1:] in (["td"], ["th"]):
            self.rows[-1].append(data)


def test_the_page_is_whole_and_fetches_nothing(reports):
    results = Results.read(reports)
    page = Page(render(results, results.stages["preprocess"]))
    assert page.open == []
    assert all(a.startswith(("#", "data:image/png;base64,")) for a in page.addresses)
    assert {a[1:] for a in page.addresses if a.startswith("#")} <= page.anchors
    assert sum(a.startswith("data:") for a in page.addresses) == 2
    text = " ".join(page.texts)
    for expected in ("abc123", "too short", "a.bvh", "a <b> walk", "a person walks <fast>", "real, ", "31.2"):
        assert expected in text or expected == "real, "


def test_rows_of_the_main_table_say_what_the_reports_say(reports):
    table = tables.text_to_motion(Results.read(reports))
    assert [row[0] for row in table.rows] == ["real motions", CHANCE, "alpha", "beta"]
    report = generator_report(0.5)
    alpha = dict(zip(table.columns, table.rows[2], strict=True))
    chance = dict(zip(table.columns, table.rows[1], strict=True))
    assert (chance["R@1"], chance["Oracle: captions"], chance["Foot skating, m/s"]) == ("-", "0.0%", "-")
    first = report["generation"]["all"]["r1"]
    assert alpha["R@1"] == (f"{first['mean']:.3f} ± {first['half']:.3f}" if first["half"] else f"{first['mean']:.3f}")
    assert alpha["FID"].startswith(f"{report['generation']['all']['fid']['mean']:.3f}")
    assert (alpha["Multimodality"], alpha["Oracle: prompts"]) == ("2.000 ± 0.100", "60.0%")
    assert alpha["Foot skating, m/s"] == "0.070"
    assert dict(zip(table.columns, table.rows[0], strict=True))["Oracle: captions"] == "95.0%"
    assert "40 test motions" in table.note
    assert "pools of 32" in table.note
    assert "pools of 10" in tables.text_to_motion(Results.read(reports), "captioned").note


def test_every_part_gets_its_tables(reports):
    titles = [table.title for table in tables.parts_tables(Results.read(reports))]
    assert titles == ["Text to motion: styled", "Text to motion: captioned", "Motion to text: styled"]


def test_captioners_are_compared_with_real_captions(reports):
    table = caption_tables.motion_to_text(Results.read(reports))
    assert [row[0] for row in table.rows] == ["real captions", "beta", "gamma"]
    real, beta = (dict(zip(table.columns, table.rows[i], strict=True)) for i in (0, 1))
    assert real["BLEU-4"] == "-"
    assert real["R@3"].startswith(f"{judged(0.1)['all']['r3']['mean']:.3f}")
    assert (beta["BLEU-4"], beta["BLEU-4, raw captions"], beta["names the action"]) == (
        "0.600 ± 0.040",
        "0.400",
        "80.0%",
    )
    assert "small" in table.note


def test_reconstructed_motions_stand_among_the_generated(reports):
    decoded = {"judge": "abc123", "reconstruction": judged(0.2), "real": judged(0.1)}
    decoded["reconstruction_oracle"] = {"all": {"confirmed": 0.75, "checked": 8}}
    (reports / "evaluation" / "codec.json").write_text(json.dumps(decoded))
    table = tables.text_to_motion(Results.read(reports))
    assert [row[0] for row in table.rows] == ["real motions", CHANCE, "real, through codec", "alpha", "beta"]
    row = dict(zip(table.columns, table.rows[2], strict=True))
    assert (row["Multimodality"], row["Oracle: captions"], row["Oracle: prompts"]) == ("-", "75.0%", "-")
    assert tables.reconstruction(Results.read(reports)).rows[0][:6] == [
        "tokenizer", "all", "9", "31.2", "40.0", "200.0",
    ]  # fmt: skip


def test_motions_at_the_real_lengths_are_a_row_below_the_system_s_own(reports):
    alpha = generator_report(0.5)
    alpha["real_lengths"] = {
        "generation": judged(0.2), "physics": {"generated": {"foot_skating": 0.05}},
        "oracle": {"captions": {"all": {"confirmed": 0.85, "checked": 20}}},
    }  # fmt: skip
    (reports / "evaluation" / "alpha.json").write_text(json.dumps(alpha))
    results = Results.read(reports)
    table = tables.text_to_motion(results)
    assert [row[0] for row in table.rows] == ["real motions", CHANCE, "alpha", "alpha with real lengths", "beta"]
    row = dict(zip(table.columns, table.rows[3], strict=True))
    assert row["R@1"].startswith(f"{judged(0.2)['all']['r1']['mean']:.3f}")
    assert (row["Multimodality"], row["Oracle: captions"], row["Foot skating, m/s"]) == ("-", "85.0%", "0.050")
    assert len(tables.text_to_motion(results, "styled").rows) == 4
    assert tables.summary(results)["alpha with real lengths"]["r3"] == judged(0.2)["all"]["r3"]["mean"]
    assert "| alpha with real lengths |" in summary.markdown(reports)


def test_lengths_stand_beside_the_histogram(reports):
    found = {"items": 9, "model": {"within_1": 0.5, "within_3": 0.75, "nll": 2.5}}
    found["histogram"] = {"within_1": 0.125, "within_3": 0.25, "nll": 3.5}
    (reports / "lengths.json").write_text(json.dumps({"lengths": {"all": found}}))
    (reports / "figures/lengths").mkdir()
    (reports / "figures/lengths/densities.png").write_bytes(PIXEL)
    results = Results.read(reports)
    assert tables.lengths(results).rows == [
        ["lengths", "all", "9", "50.0%", "75.0%", "2.500"],
        ["histogram", "all", "9", "12.5%", "25.0%", "3.500"],
    ]
    assert tables.summary(results)["lengths"] == {"length_within_1": 0.5, "length_within_3": 0.75, "length_nll": 2.5}
    page = render(results)
    assert "lengths: densities" in page
    assert "Lengths from text" in page
    assert "Lengths from text" in summary.markdown(reports)


def test_missing_reports_leave_gaps_and_no_errors(reports, tmp_path):
    empty = Results.read(tmp_path / "nothing")
    assert "dvc repro" in render(empty)
    assert tables.summary(empty) == {}
    for key in ("physics", "oracle", "multimodality", "nearest_training", "real"):
        report = generator_report(0.5)
        del report[key]
        assert Page(render(Results({"a": report}))).open == []
    bare = captioner_report()
    for key in ("action", "examples", "captioning", "real"):
        del bare[key]
    assert Page(render(Results({"a": bare}))).open == []


def test_every_model_of_a_stage_has_a_row_of_training():
    losses = {"steps": 10, "best_step": 8, "best_validation_loss": 0.12345}
    stages = {"plain": {"training": losses}, "many": {"training": losses, "member_2": {**losses, "best_step": 9}}}
    rows = tables.training(Results({}, stages)).rows
    assert [row[0] for row in rows] == ["plain", "many", "many: member_2"]
    assert rows[2][1:] == ["10", "9", "0.1235"]


def test_captions_stand_beside_those_of_a_reader_of_the_labels(reports):
    assert caption_tables.captions_by_labels(Results.read(reports)) is None  # no report has labels
    report = captioner_report()
    interval = {"mean": 0.7, "half": 0.02}
    report["labels"] = {"seen": {"items": 30, "bleu4": interval, "reader": {"mean": 0.75, "half": 0.01}, "said": 0.5}}
    report["consensus"] = {**captioner_report(), "draws": 7, "labels": {"unseen": {"items": 4, "bleu4": interval}}}
    table = caption_tables.captions_by_labels(Results({"y": report}))
    assert table.rows == [
        ["a reader who knows both", "0.750 ± 0.010", "100.0%", "-"],
        ["y", "0.700 ± 0.020", "50.0%", "-"],
        ["y by consensus of 7 draws", "-", "-", "0.700 ± 0.020"],
    ]
    assert table.note.startswith("30 test motions")


def test_the_summary_is_flat_numbers(reports):
    found = tables.summary(Results.read(reports))
    assert found["alpha"]["r3"] == generator_report(0.5)["generation"]["all"]["r3"]["mean"]
    assert found["alpha"]["oracle_prompts"] == 0.6
    assert found["real"]["r1"] == judged(0.1)["all"]["r1"]["mean"]
    assert found["gamma"]["bleu4"] == 0.6
    assert found["tokenizer"] == {"local_mm": 31.24, "global_mm": 200.0, "codes_used": 0.9}
    assert all(isinstance(value, float) for values in found.values() for value in values.values())


def test_the_terminal_table_is_aligned_and_says_where_the_page_lies(reports, monkeypatch, capsys):
    (reports / "index.html").write_text("x")
    monkeypatch.chdir(reports.parent)
    assert summary.main([]) == 0
    out = capsys.readouterr().out
    assert "reports/index.html" in out
    assert "±" not in out
    lines = [line for line in out.splitlines() if line.startswith("  ")][:4]
    assert len({len(line) for line in lines}) == 1
    assert summary.main(["markdown"]) == 0
    markdown = capsys.readouterr().out
    assert re.search(r"\| alpha \| \d\.\d{3}", markdown)
    assert summary.main(["everything"]) == 2


def test_a_damaged_report_is_one_line(reports, monkeypatch, capsys):
    (reports / "evaluation" / "alpha.json").write_text("{")
    monkeypatch.chdir(reports.parent)
    assert summary.main([]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(InputError, match=r"alpha\.json"):
        Results.read(reports)


def test_cells():
    assert show({"mean": 0.5, "half": 0.0}) == "0.500"
    assert show({"mean": 0.5, "half": 0.0123}, 2) == "0.50 ± 0.01"
    assert (show(None), show(3), show("x")) == ("-", "3", "x")
    table = Table("T", ["", "a|b"], [["x", "1|2"]])
    assert "| x | 1\\|2 |" in table.markdown()


def standing() -> Motion:
    skeleton = Skeleton.named("smpl22")
    rest = np.zeros((22, 3), np.float32)
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        rest[joint] = rest[parent] + skeleton.offsets[joint]
    return Motion(np.repeat(rest[None], 8, 0), 20.0, skeleton)


def test_examples_become_players():
    motion = standing()
    example = Example("a & b", "demo", [motion, motion], ["real", "alpha"], {"beta": "it <walks>"})
    html = motions_html([example] * 3, [("before", motion), ("<old>", motion), ("proud", motion)])
    page = Page(html)
    assert page.open == []
    assert html.count("<canvas") == 3 * 2 + 3
    assert html.index("&lt;old&gt;") < html.index("<details>") < html.rindex("a &amp; b")  # the first, styles, the rest
    assert "2 more" in html
    assert "it &lt;walks&gt;" in html
    assert html.count('"autoplay": true') == 4
    assert motions_html([]) == ""


def test_the_page_begins_with_motions_and_one_narrow_table_and_folds_the_rest(reports):
    example = Example("it walks", "demo", [standing()], ["real"], {})
    facts = {"corpus": "<demo>", "scale": "tiny", "commit": "abc", "date": "1 May 2026"}
    html = render(Results.read(reports), None, [example], facts=facts)
    assert "<b>corpus</b> &lt;demo&gt; · <b>scale</b> tiny · <b>commit</b> abc · <b>date</b> 1 May 2026" in html
    assert html.index("<canvas") < html.index("<table") < html.index("<details class='section'>")
    before = html[: html.index("<details class='section'>")]
    assert before.count("<table") == 1
    after = html[html.index("<details class='section'>") :]
    assert after.count("<table") == after.count("<div class='scroll'>") > 5
    assert Page(html).open == []


def test_the_main_table_has_every_maker_and_at_most_eight_columns(reports):
    results = Results.read(reports)
    table = headline(results)
    assert [row[0] for row in table.rows] == ["real motions and captions", "alpha", "beta", "gamma"]
    assert len(table.columns) == 8
    real, alpha, _, gamma = (dict(zip(table.columns, row, strict=True)) for row in table.rows)
    assert alpha["motion fits text, R@3"] == f"{judged(0.5)['all']['r3']['mean']:.3f}"
    assert (alpha["does what is asked"], alpha["feet slide, m/s"], alpha["BLEU-4"]) == ("60.0%", "0.070", "-")
    assert (gamma["BLEU-4"], gamma["CIDEr"], gamma["FID"]) == ("0.600", "3.000", "-")
    assert (real["feet slide, m/s"], real["BLEU-4"]) == ("0.030", "-")
    assert len(headline(Results({"gamma": captioner_report()})).columns) == 4
    assert headline(Results()) is None


def test_known_systems_are_told_in_a_sentence():
    html = systems_html(Results({"temos": {}, "somebody's own": {}}))
    assert "<dt>temos</dt>" in html
    assert "TEMOS" in html
    assert "somebody" not in html


def test_physics_stand_beside_real_motions_in_units_that_can_be_read(reports):
    measured = {"foot_skating": 0.07, "penetration": 0.004, "floating": 0.25, "jitter": 30.0, "bone_change": 0.0015}
    alpha = generator_report(0.5)
    alpha["physics"] = {"generated": measured, "real": dict.fromkeys(measured, 0.0) | {"jitter": 20.0}}
    alpha["real_lengths"] = {"generation": judged(0.2), "physics": {"generated": measured | {"floating": 0.5}}}
    decoded = {"physics": {"reconstructed": measured, "real": measured}}
    stylized = {"items": 2, "pool": 2, "rows": {"real motions": {"bone_change": {"mean": 0.002, "half": 0.001}}}}
    found = physics_tables(Results({"alpha": alpha, "codec": decoded}, {"s": {"style_transfer": {"any": stylized}}}))
    assert [table.title for table in found] == ["Physics", "Physics of stylization: any"]
    assert found[0].columns[1:3] == ["Foot skating, m/s", "Penetration, mm"]
    assert found[0].rows == [
        ["real motions", "0.000", "0.000", "0.000", "20.000", "0.000"],
        ["alpha", "0.070", "4.000", "25.000", "30.000", "1.500"],
        ["alpha with real lengths", "0.070", "4.000", "50.000", "30.000", "1.500"],
        ["real, through codec", "0.070", "4.000", "25.000", "30.000", "1.500"],
    ]
    assert found[1].rows == [["real motions", "-", "-", "-", "-", "2.000 ± 1.000"]]
    assert tables.summary(Results({"alpha": alpha}))["real"]["jitter"] == 20.0


def by_two(first: float, second: float, half: float = 0.01, **more) -> dict:
    """A report of generation whose FID and R@3 are the same by both judges, or as `more` says."""

    def row(fid: float, r3: float) -> dict:
        return {"fid": {"mean": fid, "half": 0.0}, "r3": {"mean": r3, "half": half}}

    own = {**row(first, 0.5), "items": 40, "pool": 32, "by": {"other": row(second, more.get("r3", 0.5))}}
    spread = {"mean": 2.0, "half": 0.1, "by": {"other": {"mean": 7.25, "half": 0.1}}}
    return {"judge": "a1", "judges": {"main": "a1", "other": "b2"}, "generation": {"all": own}, "real": {"all": own},
            "agreement": {"other": 0.625}, "multimodality": spread}  # fmt: skip


def test_both_judges_have_a_table_and_both_hashes_are_named():
    results = Results({"alpha": by_two(1.0, 20.0), "beta": by_two(2.0, 30.0, r3=0.75)})
    assert results.evaluators == ["a1", "b2"]
    (other,) = tables.by_other_judges(results)
    assert other.title == "Text to motion: by other"
    beta = dict(zip(other.columns, other.rows[2], strict=True))
    assert (beta["FID"], beta["R@3"], beta["Multimodality"]) == ("30.000", "0.750 ± 0.010", "7.250 ± 0.100")
    first = tables.text_to_motion(results)
    assert dict(zip(first.columns, first.rows[2], strict=True))["FID"] == "2.000"
    assert tables.summary(results)["beta"]["fid_other"] == 30.0
    assert "by other" in render(results)
    captions = captioner_report() | {"judges": {"main": "a1", "other": "b2"}}
    captions["captioning"] = {
        "all": {**captions["captioning"]["all"], "by": {"other": {"r3": {"mean": 0.25, "half": 0}}}}
    }
    table = caption_tables.motion_to_text(Results({"y": captions}))
    assert dict(zip(table.columns, table.rows[1], strict=True))["R@3 by other"] == "0.250"


def test_a_claim_counts_where_the_judges_say_the_same():
    results = Results(
        {"alpha": by_two(1.0, 30.0), "beta": by_two(2.0, 20.0, r3=0.75), "gamma": by_two(3.0, 40.0, r3=0.515)}
    )
    table = verdicts_table(results)
    assert table.columns == ["", "R@3, main", "R@3, other", "FID, main", "FID, other"]
    assert table.rows == [
        ["alpha or beta", "-", "beta", "alpha", "beta"],
        ["alpha or gamma", "-", "-", "alpha", "alpha"],  # 0.015 apart, 0.02 of interval
        ["beta or gamma", "-", "beta", "beta", "beta"],
    ]
    assert "0.62 for other" in table.note
    assert verdicts_table(Results({"alpha": generator_report(0.5), "beta": generator_report(1.0)})) is None


def test_the_preferred_generator_is_best_by_both_judges_and_no_copy():
    agreed = {"alpha": by_two(3.0, 30.0), "beta": by_two(2.0, 20.0), "retrieval": by_two(0.1, 0.1)}
    found = preferred(Results(agreed))
    assert found["text_to_motion"] == "beta"
    assert found["fid"] == {"main": {"alpha": 3.0, "beta": 2.0}, "other": {"alpha": 30.0, "beta": 20.0}}
    assert preferred(Results(agreed | {"gamma": by_two(1.0, 25.0)}))["text_to_motion"] == "gamma"  # 1 x 25 < 2 x 20
    assert preferred(Results(agreed | {"gamma": by_two(1.0, 60.0)}))["text_to_motion"] == "beta"
    assert preferred(Results({"alpha": generator_report(0.5)}))["text_to_motion"] is None  # one judge is not enough
    assert preferred(Results())["text_to_motion"] is None


def test_raw_captions_have_a_table():
    report = captioner_report()
    words = {key: {"mean": 0.25, "half": 0.125} for key in ("bleu1", "bleu4", "rouge_l", "cider")}
    report["language"]["all"]["raw"] = words
    table = caption_tables.raw_captions(Results({"y": report}))
    assert table.columns == ["", "BLEU-1", "BLEU-4", "ROUGE-L", "CIDEr"]
    assert table.rows == [["y", *["0.250 ± 0.125"] * 4]]
