"""The demo grammar through preprocess: labels arrive with the motion, and any number of workers agrees."""

import json

import pytest

from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus

DEMO = {"source": "demo", "clips": 40, "seed": 5}


@pytest.mark.parametrize("split", ["clip", "combination"])
def test_demo_corpus(tmp_path, split):
    for workers in (1, 2):
        preprocess(DEMO | {"workers": workers, "split": split}, tmp_path / str(workers), progress=False)
    one, two = (sorted((tmp_path / name).iterdir()) for name in "12")
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in two]
    corpus = Corpus.open(tmp_path / "1")
    assert json.loads((tmp_path / "1" / "report.json").read_text())["problem_count"] == 0
    assert len(set(corpus.clips.origin)) == 40
    assert (corpus.style_ids >= 0).all()
    assert (corpus.action_ids >= 0).all()
    assert not corpus.captions.human.any()
    known = [json.loads(truth)["action"] for truth in corpus.clips.attributes[~corpus.clips.mirrored]]
    assert known == corpus.clips.action[~corpus.clips.mirrored].tolist()
    cells = list(zip(corpus.clips.style.tolist(), corpus.clips.action.tolist(), strict=True))
    trained, tested = ({cells[i] for i in corpus.rows(name)} for name in ("train", "test"))
    if split == "combination":
        assert tested
        assert not trained & tested
