"""Shared blocks: normalizing, masks, positions, embeddings and recurrence."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from motionary.errors import InputError
from motionary.nn.layers import (
    Normalizer,
    TextEncoder,
    WordEmbedding,
    initialize,
    length_mask,
    load_word_vectors,
    masked_mean,
    positional_encoding,
    seeded,
)
from motionary.nn.recurrent import BiGRU


def reference(layer: BiGRU, x: torch.Tensor, lengths: torch.Tensor):
    """Cho et al.'s equations, one sequence and one step at a time."""
    unit, width = layer.unit, layer.unit.hidden_size
    outputs = x.new_zeros(*x.shape[:2], 2 * width)
    rows, last = [], []
    for row, length in enumerate(lengths.tolist()):
        ends, both = [], []
        for direction, suffix in enumerate(("l0", "l0_reverse")):
            w, v = getattr(unit, f"weight_ih_{suffix}"), getattr(unit, f"weight_hh_{suffix}")
            b, c = getattr(unit, f"bias_ih_{suffix}"), getattr(unit, f"bias_hh_{suffix}")
            state, states = x.new_zeros(width), {}
            for t in range(length) if not direction else reversed(range(length)):
                (r, z, n), (s, y, m) = (w @ x[row, t] + b).chunk(3), (v @ state + c).chunk(3)
                reset, update = torch.sigmoid(r + s), torch.sigmoid(z + y)
                state = states[t] = (1 - update) * torch.tanh(n + reset * m) + update * state
            both.append(torch.stack([states[t] for t in range(length)]))
            ends.append(state)
        padding = outputs[row, length:]
        rows.append(torch.cat((torch.cat(both, -1), padding)))
        last.append(torch.cat(ends))
    return torch.stack(rows), torch.stack(last)


def test_recurrence_and_its_gradients_are_those_of_its_equations():
    torch.manual_seed(0)
    layer, lengths = BiGRU(5, 7).double(), torch.tensor([3, 9, 1, 6])
    results = []
    for run in (reference, lambda m, x, n: m(x, n)):
        x = torch.arange(4 * 9 * 5).reshape(4, 9, 5).double().cos().requires_grad_()
        layer.zero_grad()
        out, last = run(layer, x, lengths)
        (out.sin().sum() + (last**2).sum()).backward()
        results.append([out, last, x.grad, *(p.grad.clone() for p in layer.parameters())])
    for expected, found in zip(*results, strict=True):
        torch.testing.assert_close(found, expected)


def test_last_states_alone_are_the_same_and_so_are_their_gradients():
    torch.manual_seed(0)
    layer, lengths = BiGRU(5, 7).double(), torch.tensor([3, 9, 1, 6])
    results = []
    for run in (lambda m, x, n: reference(m, x, n)[1], lambda m, x, n: m(x, n)[1], lambda m, x, n: m.last(x, n)):
        x = torch.arange(4 * 9 * 5).reshape(4, 9, 5).double().cos().requires_grad_()
        layer.zero_grad()
        last = run(layer, x, lengths)
        last.sin().sum().backward()
        results.append([last, x.grad, *(p.grad.clone() for p in layer.parameters())])
    for expected, *found in zip(*results, strict=True):
        for values in found:
            torch.testing.assert_close(values, expected)
    x = torch.arange(4 * 9 * 5).reshape(4, 9, 5).double().cos().requires_grad_()
    layer(x, lengths)[0].sin().sum().backward()  # the outputs alone
    expected = torch.autograd.grad(reference(layer, x, lengths)[0].sin().sum(), x)[0]
    torch.testing.assert_close(x.grad, expected)


def test_recurrence_passes_a_numerical_gradient_check():
    torch.manual_seed(0)
    layer, lengths = BiGRU(2, 3).double(), torch.tensor([4, 2])
    x = torch.randn(2, 4, 2, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda v: layer(v, lengths), (x,))


def test_recurrence_ignores_padding():
    torch.manual_seed(0)
    layer, x = BiGRU(5, 7), torch.randn(3, 8, 5)
    lengths = torch.tensor([8, 3, 5])
    out, last = layer(x, lengths)
    polluted = torch.where(length_mask(lengths, 8)[..., None], x, torch.full_like(x, 1e6))
    out2, last2 = layer(torch.cat((polluted, torch.ones(3, 4, 5)), 1), lengths)
    assert torch.equal(last, last2)
    assert torch.equal(out2[:, :8], out)
    assert (out2[:, 8:] == 0).all()
    assert (out[1, 3:] == 0).all()
    alone, last_alone = layer(x[1:2, :3], lengths[1:2])
    torch.testing.assert_close(alone[0], out[1, :3])
    torch.testing.assert_close(last_alone[0], last[1])


def test_backward_direction_starts_at_each_last_valid_step():
    torch.manual_seed(0)
    layer, x = BiGRU(2, 3), torch.randn(1, 6, 2)
    out, last = layer(x, torch.tensor([4]))
    flipped, flipped_last = BiGRU(2, 3), None
    state = layer.unit.state_dict()
    pairs = {name: name.removesuffix("_reverse") if "_reverse" in name else name + "_reverse" for name in state}
    flipped.unit.load_state_dict({pairs[name]: value for name, value in state.items()})
    out_flipped, flipped_last = flipped(x[:, :4].flip(1), torch.tensor([4]))
    torch.testing.assert_close(out_flipped.flip(1)[..., :3], out[:, :4, 3:])
    torch.testing.assert_close(flipped_last[:, :3], last[:, 3:])


def test_normalizer_inverts_and_refuses_zero_deviation():
    mean, std = np.float32([1, -2]), np.float32([0.5, 4])
    layer, raw = Normalizer(mean, std), torch.tensor([[1.5, 2.0]])
    assert layer(raw).tolist() == [[1.0, 1.0]]
    torch.testing.assert_close(layer.inverse(layer(raw)), raw)
    with pytest.raises(InputError, match="std"):
        Normalizer(mean, np.float32([1, 0]))


def test_masks_and_masked_mean():
    assert length_mask(torch.tensor([2, 0]), 3).tolist() == [[True, True, False], [False] * 3]
    values = torch.tensor([[[1.0, 3.0], [100.0, 100.0]]])
    assert float(masked_mean(values, torch.tensor([[True, False]]))) == 2


def test_positions_follow_their_equation():
    encoded = positional_encoding(torch.tensor([0, 3]), 6)
    assert encoded[0].tolist() == [0, 1, 0, 1, 0, 1]
    for i in range(3):
        angle = 3 / 10000 ** (2 * i / 6)
        assert encoded[1, 2 * i] == pytest.approx(math.sin(angle), abs=1e-6)
        assert encoded[1, 2 * i + 1] == pytest.approx(math.cos(angle), abs=1e-6)
    assert positional_encoding(torch.arange(4), 5).shape == (4, 5)


def test_word_vectors_keep_their_neighbors():
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(30, 12)).astype(np.float32)
    vectors[0] = 0
    vectors[7] = 0  # a word that the source does not know
    vectors[5] = vectors[6] + 0.01
    with seeded(0):
        embedding = WordEmbedding(30, 20)
    before = embedding.words.weight[7].clone()
    embedding.start_from(vectors)
    table = embedding.words.weight.detach()
    assert (table[0] == 0).all()
    assert torch.equal(table[7], before)
    distance = torch.cdist(table[5:6], table[1:])[0]
    assert int(distance.argsort()[1]) == 5  # word 6
    given = torch.cdist(torch.from_numpy(vectors[10:]), torch.from_numpy(vectors[10:]))
    ours = torch.cdist(table[10:], table[10:])
    off = ~torch.eye(20, dtype=torch.bool)
    ratio = (ours / given)[off]
    assert float(ratio.std() / ratio.mean()) < 1e-3  # a scaled isometry where dimensions suffice
    with pytest.raises(InputError, match="word vectors"):
        embedding.start_from(vectors[:5])


def test_load_word_vectors_reaches_nested_embeddings():
    encoder = TextEncoder(10, 4, 3)
    before = encoder.embedding.words.weight.detach().clone()
    load_word_vectors(encoder, None)
    assert torch.equal(encoder.embedding.words.weight, before)
    load_word_vectors(encoder, np.random.default_rng(0).normal(size=(10, 4)))
    assert not torch.equal(encoder.embedding.words.weight, before)


def test_text_encoder_reads_tags_and_ignores_padding(batch):
    with seeded(0):
        encoder = TextEncoder(14, 8, 6).eval()
        blind = TextEncoder(14, 8, 6, tags=False).eval()
    words, sentence = encoder(batch.words, batch.tags, batch.word_count)
    assert words.shape == (4, 9, 12)
    assert sentence.shape == (4, 12)
    n = int(batch.word_count[2])
    alone_words, alone = encoder(batch.words[2:3, :n], batch.tags[2:3, :n], batch.word_count[2:3])
    torch.testing.assert_close(alone[0], sentence[2])
    torch.testing.assert_close(alone_words[0], words[2, :n])
    other = (batch.tags + 1) % 15
    assert not torch.equal(encoder(batch.words, other, batch.word_count)[1], sentence)
    assert torch.equal(blind(batch.words, other, batch.word_count)[1], blind(batch.words, None, batch.word_count)[1])


def test_seeds_build_equal_modules_and_leave_the_generator_alone():
    state = torch.get_rng_state()
    built = []
    for _ in range(2):
        with seeded(5):
            built.append(torch.nn.Linear(4, 4).weight)
    assert torch.equal(*built)
    assert torch.equal(torch.get_rng_state(), state)


def test_initialize_zeroes_biases():
    layer = torch.nn.Sequential(torch.nn.Linear(4, 400))
    initialize(layer)
    assert (layer[0].bias == 0).all()
    assert float(layer[0].weight.abs().max()) <= math.sqrt(6 / 404)
