"""Held-out combinations of style and action: nothing of them trains, everything about them is known elsewhere."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from motionary.corpus.cells import style_split
from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.errors import InputError


def labels(cells, copies=6, bare=4):
    """A corpus of labels alone: `copies` clips per (style, action), each third mirrored, and clips without labels."""
    styles = sorted({style for style, _ in cells if style})
    actions = sorted({action for _, action in cells if action})
    rows = [(s, a, i, flip) for s, a in cells for i in range(copies) for flip in ((False, True) if i % 3 else (False,))]
    rows += [("", "", i, False) for i in range(bare)]
    split = np.array(["train" if flip else ("train", "train", "test", "val")[i % 4] for _, _, i, flip in rows])
    return SimpleNamespace(
        context=SimpleNamespace(styles=tuple(styles), actions=tuple(actions)),
        style_ids=np.array([styles.index(s) if s else -1 for s, *_ in rows]),
        action_ids=np.array([actions.index(a) if a else -1 for _, a, *_ in rows]),
        clips=SimpleNamespace(
            mirrored=np.array([row[3] for row in rows]),
            split=split,
            origin=np.array([f"{s}/{a}/{i}" for s, a, i, _ in rows]),
        ),
    )


CELLS = [(f"s{i}", f"a{j}") for i in range(5) for j in range(6)]


def test_cells_leave_training_whole_and_stay_known_elsewhere():
    """Held-out cells are in no training or validation row, mirrored copies included; test holds all of them."""
    corpus = labels([*CELLS, ("rare", "a0")])
    split = style_split(corpus, held_out=0.25, scored_clips=10, seed=3)  # type: ignore[arg-type]
    cell = list(zip(corpus.style_ids.tolist(), corpus.action_ids.tolist(), strict=True))
    assert [split.styles[i] for i in split.scored] == [f"s{i}" for i in range(5)]
    assert len(split.cells) == round(0.25 * 30)
    assert {s for s, _ in split.cells} == set(split.scored)
    for rows in (split.train, split.labeled, split.validation):
        assert not {cell[i] for i in rows} & set(split.cells)
    unmirrored = ~corpus.clips.mirrored
    assert set(split.test) == {i for i in np.flatnonzero(unmirrored) if cell[i] in split.cells}
    assert (corpus.clips.split[split.train] == "train").all()
    assert corpus.clips.mirrored[split.train].any()
    assert (corpus.style_ids[split.labeled] >= 0).all()
    assert len(split.references)
    assert (corpus.clips.split[split.references] == "test").all()
    assert not {cell[i] for i in split.references} & set(split.cells)
    assert set(corpus.style_ids[split.references]) <= set(split.scored)
    assert (corpus.style_ids[split.unseen] < 0).all()
    trained = {cell[i] for i in split.train}
    for style, action in split.cells:
        assert sum(s == style for s, _ in trained) >= 2
        assert sum(a == action for _, a in trained) >= 2


def test_mirrored_copies_of_what_is_held_out_do_not_train():
    """A mirrored copy lies in the mirrored action's cell; where its source is held out, it is left out all the same."""
    corpus = labels(CELLS)
    swapped = {"a0": "a1", "a1": "a0"}
    names = [swapped.get(a, a) if flip else a for a, flip in zip(
        (corpus.context.actions[i] for i in corpus.action_ids), corpus.clips.mirrored, strict=True)]  # fmt: skip
    corpus.action_ids = np.array([corpus.context.actions.index(name) for name in names])
    for seed in range(4):
        split = style_split(corpus, 0.25, 10, seed)  # type: ignore[arg-type]
        assert not {*corpus.clips.origin[split.test]} & {*corpus.clips.origin[np.r_[split.train, split.validation]]}


def test_seed_decides():
    """Equal seeds repeat, another seed holds out other cells, and the order of the clips does not matter."""
    first, again, other = (style_split(labels(CELLS), 0.25, 10, seed).cells for seed in (0, 0, 1))  # type: ignore
    turned = style_split(labels(CELLS[::-1]), 0.25, 10, 0).cells  # type: ignore[arg-type]
    assert first == again == turned != other


def test_bad_values_and_poor_corpora():
    """No labels: nothing to score; one action: an error that names the style; shares outside (0, 1) are refused."""
    bare = style_split(labels([("", "")]))  # type: ignore[arg-type]
    assert bare.scored == ()
    assert bare.cells == ()
    assert len(bare.test) == 0
    assert len(bare.train)
    with pytest.raises(InputError, match=r"s0.*hold out"):
        style_split(labels([("s0", "a0"), ("s1", "a0")]), scored_clips=1)  # type: ignore[arg-type]
    for key, value in (("held_out", 1.0), ("scored_clips", 0)):
        with pytest.raises(InputError, match=key):
            style_split(labels(CELLS), **{key: value})  # type: ignore[arg-type]


def test_mirrored_copies_carry_the_mirrored_action(folder_of, tmp_path):
    """A mirrored wave of the left hand is labeled as one of the right, so that it shares that cell's fate."""
    lines = [
        {"motion": f"motions/{i}.npy", "fps": 20, "style": "old", "action": action, "captions": []}
        for i, action in enumerate(["wave-left-hand"] * 3 + ["bow"])
    ]
    root = folder_of(tmp_path / "some", lines)
    options = {"source": "folder", "roots": [str(root)], "workers": 1, "ratios": [1, 0, 0]}
    preprocess(options, tmp_path / "corpus", progress=False)
    corpus = Corpus.open(tmp_path / "corpus")
    found = set(zip(corpus.clips.mirrored.tolist(), corpus.clips.action.tolist(), strict=True))
    assert found == {(False, "wave-left-hand"), (True, "wave-right-hand"), (False, "bow"), (True, "bow")}
