"""Batches: right frames, zero padding, exact resumption, equal work for every rank."""

import numpy as np
import pytest
import torch

from motionary.corpus.batches import Batches, Pairs, TokenStore, Windows
from motionary.errors import InputError


def same(a, b):
    return all(torch.equal(x, y) for x, y in zip(vars(a).values(), vars(b).values(), strict=True))


@pytest.fixture(scope="module")
def tokens(corpus):
    """Token k of window i is 10 i + k."""
    return TokenStore.collect([10 * i + np.arange(corpus.clips.length[i] // 4) for i in range(len(corpus))])


def test_a_batch_lacks_what_its_dataset_does_not_fill(corpus, tokens):
    batch = next(Batches(Pairs(corpus, "train", tokens, motion=False), 4).epoch(0)).to("cpu")
    assert batch.tokens.shape[0] == 4
    with pytest.raises(AttributeError, match="motion"):
        _ = batch.motion
    windows = next(Batches(Windows(corpus, "train", 32), 4).epoch(0))
    assert windows.tags is None
    with pytest.raises(AttributeError, match="words"):
        _ = windows.words


def check_padding(corpus, batch):
    for i, row in enumerate(batch.clip.tolist()):
        count = int(batch.frames[i])
        assert (batch.motion[i, count:] == 0).all()
        features = torch.from_numpy(np.array(corpus.features(row)))
        starts = range(0, len(features) - count + 1)
        assert any(torch.equal(batch.motion[i, :count], features[s : s + count]) for s in starts)


@pytest.mark.parametrize("window", [16, 64, 300])
def test_windows_hold_stretches_of_their_clip(corpus, window):
    for batch in Batches(Windows(corpus, "train", window), 8, seed=1).epoch(0):
        assert batch.motion.shape[1:] == (window, corpus.context.dim)
        assert batch.motion.dtype == torch.float32
        lengths = torch.from_numpy(corpus.clips.length[batch.clip.numpy()])
        assert torch.equal(batch.frames, lengths.clamp(max=window))
        check_padding(corpus, batch)


def test_windows_of_validation_cover_the_clip_evenly(corpus):
    data = Windows(corpus, "val", 24)
    for row in np.unique(data.rows):
        starts = data.starts[data.rows == row]
        assert starts[0] == 0
        assert starts[-1] in (0, corpus.clips.length[row] - 24)
        assert len(starts) == corpus.clips.length[row] // 24
    first, second = (next(Batches(data, 4, shuffle=False).epoch(e)) for e in (0, 1))
    assert same(first, second)


def test_windows_include_uncaptioned_clips_and_count_by_length(corpus):
    rows = Windows(corpus, "train", 32).rows
    assert set(rows) == set(corpus.rows("train"))
    assert np.isin(corpus.rows("train", captioned=False), rows).all()
    assert len(Windows(corpus, "train", 32, uniform=True)) == len(corpus.rows("train"))


def test_pairs_have_words_of_their_caption(corpus):
    data = Pairs(corpus, "test", all_captions=True)
    assert len(data) == sum(len(corpus.captions_of(i)) for i in corpus.rows("test"))
    vocabulary = corpus.context.vocabulary
    for batch in Batches(data, 3, shuffle=False).epoch(0):
        assert torch.equal(torch.from_numpy(corpus.captions.clip[batch.caption.numpy()]), batch.clip)
        assert torch.equal(torch.from_numpy(corpus.captions.key[batch.caption.numpy()]), batch.text_key)
        for i, caption in enumerate(batch.caption.tolist()):
            count = int(batch.word_count[i])
            assert batch.words[i, 0] == 1
            assert batch.words[i, count - 1] == 2
            assert (batch.words[i, count:] == 0).all()
            expected = [vocabulary.ids.get(word, 3) for word in corpus.captions.words[caption]]
            assert batch.words[i, 1 : count - 1].tolist() == expected
        check_padding(corpus, batch)


def test_training_pairs_drop_one_unit_in_a_third_of_the_draws(corpus, tokens):
    data = Pairs(corpus, "train", tokens)
    dropped, heads, captions = [], [], set()
    for epoch in range(40):
        for batch in Batches(data, 16, seed=2).epoch(epoch):
            check_padding(corpus, batch)
            missing = torch.from_numpy(corpus.clips.length[batch.clip.numpy()]) - batch.frames
            assert set(missing.tolist()) <= {0, 4}
            assert torch.equal(batch.token_count * 4, batch.frames)
            first = batch.tokens[:, 0] - 10 * batch.clip
            for i, count in enumerate(batch.token_count.tolist()):
                codes = 10 * batch.clip[i] + first[i] + torch.arange(count)
                assert torch.equal(batch.tokens[i, :count], codes)
                assert (batch.tokens[i, count:] == 0).all()
                # Tokens and frames start at the same place.
                start = 4 * int(first[i])
                frames = corpus.features(int(batch.clip[i]))[start : start + 4 * count]
                np.testing.assert_array_equal(batch.motion[i, : 4 * count].numpy(), frames)
            dropped += (missing > 0).tolist()
            heads += (first[missing > 0] > 0).tolist()
            captions |= set(batch.caption.tolist())
    assert abs(np.mean(dropped) - 1 / 3) < 0.04
    assert abs(np.mean(heads) - 1 / 2) < 0.06
    trained = np.isin(corpus.captions.clip, corpus.rows("train"))
    assert captions == set(np.flatnonzero(trained))


def test_evaluation_pairs_are_whole(corpus, tokens):
    for batch in Batches(Pairs(corpus, "test", tokens), 4, shuffle=False).epoch(0):
        assert (batch.frames.numpy() == corpus.clips.length[batch.clip.numpy()]).all()


@pytest.mark.parametrize("length_sorted", [False, True])
@pytest.mark.parametrize("kind", ["windows", "pairs"])
def test_an_interrupted_epoch_continues_exactly(corpus, kind, length_sorted):
    def batches():
        data = Windows(corpus, "train", 32) if kind == "windows" else Pairs(corpus, "train")
        return Batches(data, 5, seed=7, length_sorted=length_sorted)

    whole = list(batches().epoch(3))
    rest = list(batches().epoch(3, start=4))
    assert len(whole) == len(batches())
    assert len(rest) == len(whole) - 4
    assert all(same(a, b) for a, b in zip(whole[4:], rest, strict=True))
    assert not same(whole[0], next(batches().epoch(4)))


@pytest.mark.parametrize("length_sorted", [False, True])
def test_an_epoch_has_every_entry_once(corpus, length_sorted):
    data = Pairs(corpus, "train")
    drawn = np.concatenate(Batches(data, 7, seed=0, length_sorted=length_sorted).order(0))
    assert sorted(drawn) == list(range(len(data)))


def test_sorting_by_length_pads_less(corpus):
    def padding(length_sorted):
        batches = Batches(Pairs(corpus, "train"), 8, seed=0, length_sorted=length_sorted).epoch(0)
        return np.mean([1 - b.frames.sum() / b.motion[..., 0].numel() for b in batches])

    assert padding(True) < 0.5 * padding(False)


def test_ranks_share_the_global_batches(corpus):
    data = Pairs(corpus, "train")
    orders = Batches(data, 8, seed=5).order(2)
    ranks = [list(Batches(data, 4, seed=5, rank=rank, world=2).epoch(2)) for rank in (0, 1)]
    assert len(ranks[0]) == len(ranks[1]) == len(orders)
    for whole, a, b in zip(orders, *ranks, strict=True):
        clips = set(a.clip.tolist()) | set(b.clip.tolist())
        assert set(data.rows[whole].tolist()) <= clips
        assert len(a) == len(b)


@pytest.mark.parametrize(("balance", "expected"), [(0.0, 0.25), (0.5, 1 / (1 + 3**0.5)), (1.0, 0.5)])
def test_balance_draws_a_small_root_more_often_and_keeps_the_epoch(corpus, monkeypatch, balance, expected):
    rows = Pairs(corpus, "train").rows
    group = corpus.clips.group.copy()
    group[rows[: len(rows) // 4]] = "rare"
    monkeypatch.setattr(corpus, "clips", type(corpus.clips)(**vars(corpus.clips) | {"group": group}))
    data = Pairs(corpus, "train", balance=balance)
    batches = Batches(data, 8, seed=0)
    drawn = np.concatenate([np.concatenate(batches.order(epoch)) for epoch in range(100)])
    assert len(drawn) == 100 * len(data)
    assert abs((group[data.rows[drawn]] == "rare").mean() - expected) < 0.03


def test_captions_are_drawn_by_the_weight_of_their_source(corpus, monkeypatch):
    """Two captions a window: the heavy one three times as often, and windows without it a third as often."""
    train = corpus.rows("train", captioned=True)
    plain = train[: len(train) // 2]
    weight = np.ones(len(corpus.captions), np.float32)
    heavy = np.array([corpus.caption_start[row] for row in train if row not in plain])
    weight[heavy] = 3
    monkeypatch.setattr(corpus, "captions", type(corpus.captions)(**vars(corpus.captions) | {"weight": weight}))
    data = Pairs(corpus, "train")
    batches = [b for epoch in range(60) for b in Batches(data, 16, seed=0).epoch(epoch)]
    rows = np.concatenate([b.clip.numpy() for b in batches])
    captions = np.concatenate([b.caption.numpy() for b in batches])
    assert (corpus.captions.clip[captions] == rows).all()
    expected = len(plain) / (len(plain) + 3 * (len(train) - len(plain)))
    assert abs(np.isin(rows, plain).mean() - expected) < 0.03
    assert abs(np.isin(captions, heavy).sum() / (~np.isin(rows, plain)).sum() - 0.75) < 0.03
    first = captions[np.isin(rows, plain)]
    assert abs(np.isin(first, corpus.caption_start[plain]).mean() - 0.5) < 0.06


def test_shifted_motion_and_tokens_belong_together(corpus):
    unit = corpus.context.unit
    stores = [
        TokenStore.collect([[1000 * shift + i for i in range((n - shift) // unit)] for n in corpus.clips.length])
        for shift in range(unit)
    ]
    data = Pairs(corpus, "train", stores, shifts=unit, drop_unit=0.5)
    seen = set()
    for batch in Batches(data, 4, seed=3).epoch(0):
        assert (batch.frames == batch.token_count * unit).all()
        for row, motion, frames, tokens in zip(
            batch.clip.tolist(), batch.motion.numpy(), batch.frames.tolist(), batch.tokens.tolist(), strict=True
        ):
            shift, first = divmod(tokens[0], 1000)
            seen.add((shift, first))
            assert tokens[: frames // unit] == [1000 * shift + first + i for i in range(frames // unit)]
            start = shift + first * unit
            np.testing.assert_array_equal(motion[:frames], corpus.features(row)[start : start + frames])
    assert {shift for shift, _ in seen} == set(range(unit))
    assert {first for _, first in seen} == {0, 1}


def test_one_shift_draws_as_without(corpus, tokens):
    one = next(Batches(Pairs(corpus, "train", tokens), 8, seed=1).epoch(0))
    other = next(Batches(Pairs(corpus, "train", [tokens], shifts=1), 8, seed=1).epoch(0))
    assert same(one, other)


def test_drop_last_keeps_the_only_batch(corpus):
    data = Pairs(corpus, "train")
    assert len(Batches(data, 10**6, drop_last=True)) == 1
    assert len(Batches(data, 5, drop_last=True)) == len(data) // 5
    assert {len(batch) for batch in Batches(data, 5, drop_last=True).epoch(0)} == {5}


def test_token_store_round_trip(tmp_path, tokens):
    tokens.save(tmp_path / "tokens")
    again = TokenStore.load(tmp_path / "tokens")
    assert len(again) == len(tokens)
    for i in range(len(tokens)):
        np.testing.assert_array_equal(again[i], tokens[i])
    assert TokenStore.collect([np.array([70_000])]).tokens.dtype == np.int32
    with pytest.raises(InputError, match=r"tokens\.npy"):
        TokenStore.load(tmp_path)


def test_bad_arguments_say_so(corpus, tokens):
    for wrong in ({"batch_size": 0}, {"batch_size": 4, "rank": 2, "world": 2}):
        with pytest.raises(InputError):
            Batches(Pairs(corpus, "train"), **wrong)
    with pytest.raises(InputError, match="window"):
        Windows(corpus, "train", 0)
    with pytest.raises(InputError, match="tokens"):
        Pairs(corpus, "train", TokenStore.collect([np.arange(3)]))
    with pytest.raises(InputError, match="drop_unit"):
        Pairs(corpus, "train", drop_unit=1.5)
    with pytest.raises(InputError, match=r"balance: 1\.5"):
        Windows(corpus, "train", balance=1.5)
    with pytest.raises(InputError, match=r"shifts: 5: .*1\.\.4"):
        Pairs(corpus, "train", shifts=5)
    with pytest.raises(InputError, match="tokens: 1 stores"):
        Pairs(corpus, "train", tokens, shifts=2)
