"""Sentences by sentences: pairs that say the same are found, pairs that say nothing are found by chance alone."""

from __future__ import annotations

import json

import numpy as np

from motionary.bench.agreement import agreement, main
from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.motion import Skeleton

# fmt: off
WHO = ["dog", "cat", "horse", "king", "nurse", "pilot", "sailor", "baker", "clown", "monk", "judge", "poet", "robot",
       "ghost", "pirate", "farmer"]
WHAT = ["ladder", "piano", "garden", "sword", "soup", "candle", "river", "letter", "mountain", "violin"]
# fmt: on


def corpus_of(folder, texts: list[tuple[str, ...]]) -> Corpus:
    """A clip for each pair of sentences, by `annotators`."""
    (folder / "motions").mkdir(parents=True)
    with (folder / "clips.jsonl").open("w") as listing:
        for i, captions in enumerate(texts):
            sway = 0.05 * np.sin(np.arange(40) / 5 + i)[:, None, None]
            np.save(folder / f"motions/{i}.npy", (Skeleton.named("smpl22").rest + sway).astype(np.float32))
            told = [{"text": text, "source": "annotators"} for text in captions]
            listing.write(json.dumps({"motion": f"motions/{i}.npy", "fps": 20, "captions": told}) + "\n")
    settings = {"source": "folder", "roots": [str(folder)], "workers": 1, "ratios": [0.9, 0.05, 0.05], "mirror": False}
    preprocess(settings, folder / "corpus", progress=False)
    return Corpus.open(folder / "corpus")


def test_sentences_that_say_the_same_are_found_and_others_by_chance(tmp_path, capsys):
    same = [(f"the {who} and the {what}", f"a {who} with a {what}") for who in WHO for what in WHAT]
    known = corpus_of(tmp_path / "same", same)
    (row,) = agreement(known).rows
    assert row[0] == "train"
    assert int(row[1]) > 100
    assert float(row[2].split()[0]) > 0.9
    others = [same[i][1] for i in np.random.default_rng(0).permutation(len(same))]
    (row,) = agreement(corpus_of(tmp_path / "mixed", list(zip((a for a, _ in same), others, strict=True)))).rows
    assert float(row[4].split()[0]) < 0.2  # 3 of 32 by chance
    # Of a source that wrote nothing, or one sentence each, there is nothing to say.
    assert main([str(tmp_path / "same/corpus"), "--source", "nobody"]) == 2
    assert "needs 32 windows of a split with two each" in capsys.readouterr().err
    assert main([str(tmp_path / "same/corpus"), "--source", "annotators"]) == 0
    assert "| train |" in capsys.readouterr().out
