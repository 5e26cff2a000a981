"""One bad line, name, link or text never ends a run: it is that clip's problem, and the others become a corpus."""

from __future__ import annotations

import json

import pytest

from motionary.corpus import tagging
from motionary.corpus.preprocess import preprocess
from motionary.corpus.sources import inventory

GOOD = '{"motion": "motions/good.npy", "fps": 20, "captions": [{"text": "a person walks"}]}\n'


def _built(root, out):
    inventory(root, progress=False)
    settings = {"source": "folder", "roots": [str(root)], "workers": 1, "mirror": False, "ratios": [1.0, 0.0, 0.0]}
    return preprocess(settings, out, progress=False)


@pytest.mark.parametrize(
    ("line", "rule"),
    [
        (f'{{"motion": "motions/bad.npy", "fps": {"9" * 400}}}', "must be above 0"),
        (f'{{"motion": "motions/bad.npy", "fps": {"9" * 5000}}}', "one JSON object"),
        (
            '{"motion": "motions/bad.npy", "fps": 20, "captions": [{"text": "a \\ud83d runs"}]}',
            "half of a character",
        ),
        ('{"motion": "motions/bad.npy", "fps": 20, "style": "\\ude00"}', "half of a character"),
        ('{"motion": "motions/\\ud83d.npy", "fps": 20}', "half of a character"),
        (json.dumps({"motion": "n" * 5000 + ".npy", "fps": 20}), "listed but absent"),
        ('{"motion": "motions/bad.npy", "fps": 20, "mapping": ' + "[" * 90_000 + "}", "one JSON object"),
        (
            '{"motion": "motions/bad.npy", "fps": 20, "mapping": ' + "[" * 500 + "]" * 500 + "}",
            "must be a JSON file",
        ),
        ('{"motion": "motions/link.npy", "fps": 20}', "leads out of the folder"),
        ('{"motion": "motions/bad.npy", "fps": 20, "unit": ' + "9" * 400 + "}", "must be metres per unit"),
        (
            json.dumps({"motion": "motions/bad.npy", "fps": 20, "captions": [{"text": "a person walks"}] * 1001}),
            "a clip may have 1,000",
        ),
    ],
)
def test_a_line_nobody_can_use(tmp_path, folder_of, line, rule):
    root = folder_of(tmp_path / "root", [{"motion": "motions/good.npy"}, {"motion": "motions/bad.npy"}])
    elsewhere = folder_of(tmp_path / "other", [{"motion": "motions/a.npy"}])
    (root / "motions/link.npy").symlink_to(elsewhere / "motions/a.npy")
    (root / "clips.jsonl").write_text(GOOD + line + "\n")
    report = _built(root, tmp_path / "corpus")
    assert report["problem_count"] == 1
    assert rule in report["problems"][0]["rule"]
    assert "clips.jsonl:2" in report["problems"][0]["file"]
    assert report["kept"] == (2 if "captions" in line else 1)  # a bad caption costs its clip nothing else


def test_a_text_that_the_tagger_fails_on(tmp_path, folder_of, monkeypatch):
    """Found out after all clips were encoded, it costs its own caption only."""
    root = folder_of(tmp_path / "root", [{"motion": "motions/good.npy"}])
    two = GOOD.replace("}]}", '}, {"text": "a cursed text"}]}')
    (root / "clips.jsonl").write_text(two)

    def fragile(texts):
        if any("cursed" in text for text in texts):
            raise KeyError("cursed")
        return usual(texts)

    usual = tagging.annotate
    monkeypatch.setattr(tagging, "annotate", fragile)
    report = _built(root, tmp_path / "corpus")
    assert report["captions"] == 1
    assert any("KeyError" in row["value"] for row in report["problems"])
