"""Captions of several sources: each wording is learned behind a tag, and decoding says whose words to use."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from motionary.corpus.batches import Batches, Pairs
from motionary.corpus.caption_words import caption_sources, captions_vocabulary
from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.dictionary.dictionary import Dictionary
from motionary.errors import InputError
from motionary.motion import Skeleton
from motionary.nn.layers import seeded
from motionary.systems.io import save_model
from motionary.systems.tm2t.captioner import Captioner
from motionary.systems.tm2t.inverse_alignment import InverseAlignment, InverseAlignmentConfig
from motionary.systems.tm2t.motion2text import Motion2Text, Motion2TextConfig

SAID = {  # by source, of a body that stands low, in the middle and high
    "people": ("a person crouches", "a person stands", "a person jumps"),
    "index": ("crouch", "stand", "leap"),
}
SMALL = {"width": 32, "num_layers": 1, "dim_feedforward": 32, "num_heads": 2, "dropout": 0.0, "tokens": False}


def body(height: float, seed: int) -> np.ndarray:
    """(41, 22, 3) a body that sways a little, its joints around `height` metres."""
    skeleton, rng = Skeleton.named("smpl22"), np.random.default_rng(seed)
    rest = np.zeros((22, 3))
    for joint, parent in enumerate(skeleton.parents):
        rest[joint] = skeleton.offsets[joint] + (rest[parent] if parent >= 0 else 0)
    rest[:, 1] *= height
    sway = 0.02 * np.sin(np.arange(41)[:, None, None] / 5 + rng.random((1, 22, 3)))
    return (rest - [0, rest[:, 1].min(), 0] + sway).astype(np.float32)


def built(folder, said=SAID, **config) -> Corpus:
    """A corpus of twelve clips; every clip has one caption of each source that has one for it."""
    (folder / "clips").mkdir(parents=True)
    lines = []
    for i in range(12):
        np.save(folder / f"clips/{i}.npy", body((0.6, 1.0, 1.4)[i % 3], i))
        captions = [{"text": texts[i % 3], "source": source} for source, texts in said.items() if texts[i % 3]]
        lines.append(json.dumps({"motion": f"clips/{i}.npy", "fps": 20, "captions": captions}))
    (folder / "clips.jsonl").write_text("\n".join(lines))
    values = {"source": "folder", "roots": [str(folder)], "workers": 1, "mirror": False, "ratios": [0.5, 0.25, 0.25]}
    preprocess({**values, **config}, folder / "corpus", progress=False)
    return Corpus.open(folder / "corpus")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory) -> Corpus:
    """Captions of people, and phrases of an index that weigh as much."""
    return built(tmp_path_factory.mktemp("two") / "data", {"index": SAID["index"], "people": SAID["people"]})


@pytest.fixture(scope="module")
def captioner(corpus) -> Captioner:
    """Trained on both sources until it knows them by heart."""
    sources = caption_sources(corpus, "people")
    written = captions_vocabulary(corpus)
    context = replace(corpus.context, vocabulary=written)
    with seeded(0):
        net = Motion2Text(Motion2TextConfig(8, wording="written", sources=sources, **SMALL), context)
        data = Pairs(corpus, "train", drop_unit=0, all_captions=True, sources=sources, written=written)
        optimizer, generator = torch.optim.Adam(net.parameters(), 5e-3), torch.Generator()
        for epoch in range(100):
            for batch in Batches(data, 16, seed=1).epoch(epoch):
                loss, _ = net.loss(batch, 0.0, generator)
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()
    return Captioner([net.eval()], None)


def expected(corpus: Corpus, row: int, source: str) -> str:
    """The caption of a window that comes from a source, as it was written."""
    (caption,) = [c for c in corpus.captions_of(row) if corpus.captions.source[c] == source]
    return str(corpus.captions.text[caption])


def test_each_tag_gives_the_wording_of_its_source(corpus, captioner):
    assert captioner.sources == ("people", "index")
    rows = corpus.rows("train")
    features = [corpus.features(i) for i in rows]
    for source in SAID:
        assert captioner.caption(features, source=source) == [[expected(corpus, i, source)] for i in rows]
        drawn = captioner.caption(features, source=source, temperature=0.3)
        assert drawn == [[expected(corpus, i, source)] for i in rows]
    assert captioner.caption(features) == captioner.caption(features, source="people")  # the usual one


def test_a_dictionary_says_it_in_the_words_of_a_source(corpus, captioner, tmp_path):
    save_model(tmp_path / "motion2text", "motion2text", captioner.members[0], captioner.context)
    dictionary, row = Dictionary(tmp_path), int(corpus.rows("train")[0])
    motion = corpus.motion(row)
    assert dictionary.caption(motion, source="index") == [expected(corpus, row, "index")]
    assert dictionary.caption(motion) == [expected(corpus, row, "people")]
    with pytest.raises(InputError, match=r"source: novelists: must be a source .* knows: people, index"):
        dictionary.caption(motion, source="novelists")


def test_the_usual_source_has_most_captions_by_weight_and_of_equal_ones_is_of_people(corpus, tmp_path):
    assert caption_sources(corpus) in (("index", "people"), ("people", "index"))  # alike in all
    few = {"people": (*SAID["people"][:1], None, None), "class-template": SAID["people"]}
    assert caption_sources(built(tmp_path / "few", few)) == ("class-template", "people")
    heavy = built(tmp_path / "heavy", few, source_weights={"people": 9.0})
    assert caption_sources(heavy) == ("people", "class-template")
    assert caption_sources(corpus, "index") == ("index", "people")
    with pytest.raises(InputError, match=r"motion2text\.source: nobody: must be best, none or one of"):
        caption_sources(corpus, "nobody")
    weighed = built(tmp_path / "weighed", SAID, source_weights={"people": 3.0})
    assert caption_sources(weighed) == ("people", "index")
    templates = {"class-template": SAID["people"], "people": SAID["people"]}
    assert caption_sources(built(tmp_path / "templates", templates))[0] == "people"
    assert caption_sources(built(tmp_path / "one", {"people": SAID["people"]})) == ()


def test_a_captioner_of_one_source_is_what_it_was(corpus):
    with seeded(4):
        plain = Motion2Text(Motion2TextConfig(8, **SMALL), corpus.context)
    with seeded(4):
        tagged = Motion2Text(Motion2TextConfig(8, sources=("a", "b"), **SMALL), corpus.context)
    assert set(tagged.state_dict()) - set(plain.state_dict()) == {"tags.weight"}
    assert all(torch.equal(value, tagged.state_dict()[name]) for name, value in plain.state_dict().items())
    batch = next(Batches(Pairs(corpus, "train"), 4).epoch(0))
    assert not hasattr(batch, "source")
    assert plain.source_of(batch)[0].shape[1] == batch.motion.shape[1]


def test_inverse_alignment_reads_what_people_wrote_and_writes_tokens_for_normalized_words(corpus):
    written = captions_vocabulary(corpus)
    with seeded(0):
        settings = {**SMALL, "tokens": True, "wording": "written"}
        reader = Motion2Text(Motion2TextConfig(8, **settings), replace(corpus.context, vocabulary=written))
        config = InverseAlignmentConfig(8, word_dim=8, text_width=8, width=8)
        model = InverseAlignment(config, corpus.context).eval()
    model.learn_from(reader)
    data = Pairs(corpus, "train", drop_unit=0, motion=False, all_captions=True, **model.reads)
    batch = data.collate(np.arange(4), np.random.default_rng(0))
    texts = [corpus.captions.text[caption] for caption in batch.caption]
    assert [written.decode(row) for row in batch.said.numpy()] == texts
    assert [corpus.context.vocabulary.decode(row) for row in batch.words.numpy()] != texts
    before = model.caption_loss(batch, torch.Generator().manual_seed(0))[0].detach()
    batch.said = batch.said.flip(0)
    after = model.caption_loss(batch, torch.Generator().manual_seed(0))[0].detach()
    assert abs(float(before) - float(after)) > 1e-4  # the same samples, read as other words


def test_inverse_alignment_reads_each_caption_under_its_own_tag(corpus):
    with seeded(0):
        reader = Motion2Text(
            Motion2TextConfig(8, sources=("people", "index"), **{**SMALL, "tokens": True}), corpus.context
        )
        config = InverseAlignmentConfig(8, word_dim=8, text_width=8, width=8, sampled_share=0.5)
        model = InverseAlignment(config, corpus.context).eval()
    model.learn_from(reader)
    assert model.reads == {"sources": ("people", "index"), "said": None}
    data = Pairs(corpus, "train", drop_unit=0, motion=False, all_captions=True, **model.reads)
    batch = data.collate(np.arange(4), np.random.default_rng(0))
    assert batch.source.tolist() == [1, 0, 1, 0]  # every clip's index phrase comes first

    def loss(sources: list[int]) -> float:
        batch.source = torch.tensor(sources)
        return float(model.caption_loss(batch, torch.Generator().manual_seed(0))[0].detach())

    sources = [1, 0, 1, 0]
    read = loss(sources)
    sampled = torch.randperm(4, generator=torch.Generator().manual_seed(0))[:2]  # half of the batch
    for caption in range(4):
        other = sources.copy()
        other[caption] = 1 - other[caption]
        assert (loss(other) == pytest.approx(read, abs=1e-6)) == (caption not in sampled)
