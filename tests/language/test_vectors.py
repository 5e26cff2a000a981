"""Word vectors from a file and from the packaged language model, and its sentence embeddings."""

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.language import END, PAD, START, UNKNOWN, Sentence, Vocabulary, sentence_embeddings, word_vectors


@pytest.fixture(scope="module")
def vocabulary():
    words = ("walk", "jog", "violin", "zqx")
    return Vocabulary.build([Sentence("", words, ("NOUN",) * len(words))])


def test_vectors_of_a_file(vocabulary, tmp_path):
    path = tmp_path / "glove.txt"
    path.write_text("the 9 9 9\nwalk 1 0 0.5\njog 3 2 -1.5\n. 0 0 x\nviolin -1 1 0\n", encoding="utf-8")
    vectors = word_vectors(vocabulary, path)
    assert vectors.shape == (8, 3)
    assert vectors.dtype == np.float32
    np.testing.assert_allclose(vectors[vocabulary.ids["walk"]], [1, 0, 0.5])
    np.testing.assert_allclose(vectors[vocabulary.ids["zqx"]], [1, 1, -1 / 3], atol=1e-6)
    np.testing.assert_allclose(vectors[UNKNOWN], [1, 1, -1 / 3], atol=1e-6)
    assert not vectors[PAD].any()
    assert not np.allclose(vectors[START], vectors[END])


@pytest.mark.parametrize("content", ["walk 1 2\njog 1\n", "walk 1 x\n", "walk\n", "the 1 2\n", "walk 1 nan\n", ""])
def test_broken_files_are_named(vocabulary, tmp_path, content):
    path = tmp_path / "glove.txt"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"glove\.txt"):
        word_vectors(vocabulary, path)


def test_a_missing_file_is_named(vocabulary, tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        word_vectors(vocabulary, tmp_path / "nowhere")


def test_learned_vectors_start_from_nothing(vocabulary):
    assert word_vectors(vocabulary, "learned") is None


def test_language_model_puts_like_words_together(vocabulary):
    vectors = word_vectors(vocabulary, "auto")
    assert vectors.shape == (8, 384)
    assert np.sqrt((vectors[4:] ** 2).mean()) == pytest.approx(0.4, rel=1e-4)

    def cosine(a, b):
        a, b = vectors[vocabulary.ids[a]], vectors[vocabulary.ids[b]]
        return a @ b / np.linalg.norm(a) / np.linalg.norm(b)

    assert cosine("walk", "jog") > cosine("walk", "violin") + 0.1
    np.testing.assert_array_equal(vectors, word_vectors(vocabulary, "language_model"))


def test_sentence_embeddings_are_unit_rows_free_of_their_batch():
    texts = ["a person walks forward", "someone is strolling ahead", "a violin is played very quietly in a hall", ""]
    rows = sentence_embeddings(texts)
    assert rows.shape == (4, 384)
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, atol=1e-5)
    np.testing.assert_allclose(sentence_embeddings(texts[:1]), rows[:1], atol=1e-5)
    assert rows[0] @ rows[1] > rows[0] @ rows[2] + 0.2
    assert sentence_embeddings([]).shape == (0, 384)


def test_a_model_that_is_not_here_is_named(tmp_path):
    with pytest.raises(InputError, match="locally stored"):
        sentence_embeddings(["walk"], tmp_path)
