"""Splits do not leak, keep their shares, and do not depend on the order of the clips."""

from collections import Counter

import numpy as np
import pytest

from motionary.corpus.clips import Caption, Clip
from motionary.corpus.splits import SPLITS, split_clips
from motionary.errors import InputError

RATIOS = (0.8, 0.05, 0.15)


def labelled(count=1000, **given):
    rng = np.random.default_rng(0)
    return [
        Clip(
            f"root/{i:04d}",
            None,
            "",
            "root",
            subject=f"subject{rng.integers(30)}",
            style=f"style{rng.integers(8)}",
            action=f"action{rng.integers(10)}",
            captions=(Caption("a", source=str(rng.choice(["human", "template"]))),),
            **given,
        )
        for i in range(count)
    ]


@pytest.mark.parametrize("kind", ["clip", "subject", "combination"])
def test_order_does_not_matter_and_seed_does(kind):
    clips = labelled()
    shuffled = [clips[i] for i in np.random.default_rng(1).permutation(len(clips))]
    assert split_clips(clips, kind, RATIOS, 3) == split_clips(shuffled, kind, RATIOS, 3)
    assert split_clips(clips, kind, RATIOS, 3) != split_clips(clips, kind, RATIOS, 4)


@pytest.mark.parametrize(("kind", "slack"), [("clip", 0.002), ("subject", 0.05), ("combination", 0.03)])
def test_shares(kind, slack):
    counts = Counter(split_clips(labelled(), kind, RATIOS, 0).values())
    for split, ratio in zip(SPLITS, RATIOS, strict=True):
        assert abs(counts[split] / 1000 - ratio) <= slack


def test_split_by_clip_is_stratified():
    clips = labelled()
    splits = split_clips(clips, "clip", RATIOS, 0)
    for source in ("human", "template"):
        tested = [splits[clip.id] == "test" for clip in clips if clip.captions[0].source == source]
        assert abs(np.mean(tested) - 0.15) < 0.01


def test_a_subject_is_in_one_split():
    clips = labelled()
    splits = split_clips(clips, "subject", RATIOS, 0)
    seen = {(clip.subject, splits[clip.id]) for clip in clips}
    assert len(seen) == len({subject for subject, _ in seen})


def test_a_held_out_combination_is_new_but_its_parts_are_not():
    clips = labelled()
    splits = split_clips(clips, "combination", RATIOS, 0)
    cells = {name: {(c.style, c.action) for c in clips if splits[c.id] == name} for name in SPLITS}
    assert not cells["train"] & cells["test"]
    assert not cells["train"] & cells["val"]
    assert not cells["val"] & cells["test"]
    for position in (0, 1):
        trained = {cell[position] for cell in cells["train"]}
        assert {cell[position] for cell in cells["test"] | cells["val"]} <= trained


@pytest.mark.parametrize("kind", ["clip", "subject", "combination"])
def test_a_mirrored_copy_stays_with_its_original(kind):
    clips = labelled(300)
    twins = [Clip(f"{c.id}M", None, "", "root", origin=c.id, mirrored=True) for c in clips]
    splits = split_clips(clips + twins, kind, RATIOS, 0)
    assert all(splits[twin.id] == splits[twin.origin] for twin in twins)


def test_given_splits_are_kept_and_the_rest_goes_by_clip():
    clips = labelled(100, split="test") + [Clip(f"other/{i}", None, "", "other") for i in range(100)]
    splits = split_clips(clips, "given", RATIOS, 0)
    assert {splits[clip.id] for clip in clips[:100]} == {"test"}
    assert Counter(splits[clip.id] for clip in clips[100:]) == {"train": 80, "val": 5, "test": 15}


def test_splits_that_cannot_be_made_say_so():
    bare = [Clip(f"x/{i}", None, "", "x") for i in range(10)]
    for kind in ("given", "combination"):
        with pytest.raises(InputError, match=r"data\.split"):
            split_clips(bare, kind, RATIOS, 0)
    alone = [Clip(f"x/{i}", None, "", "x", subject="only") for i in range(10)]
    with pytest.raises(InputError, match=r"data\.split"):
        split_clips(alone, "subject", RATIOS, 0)
