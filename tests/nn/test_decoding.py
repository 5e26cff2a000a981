"""Decoding against closed forms: exhaustive search, softmax frequencies, independence of the batch."""

from __future__ import annotations

import itertools

import pytest
import torch

from motionary.errors import InputError
from motionary.nn.decoding import Averaged, Sampling, beam_search, sample
from motionary.nn.noise import uniform_noise

START, END, WORDS = 0, 1, 5


class Table:
    """A toy decoder: the next token's logits depend on the item and on the last two tokens."""

    def __init__(self, items: int, seed: int = 0, scale: float = 1.5):
        generator = torch.Generator().manual_seed(seed)
        self.logits = scale * torch.randn(items, WORDS, WORDS, WORDS, generator=generator)
        self.scored = 0

    def first(self, items: int):
        return torch.arange(items), torch.zeros(items, dtype=torch.long)

    def step(self, state, tokens):
        item, before = state
        self.scored += len(tokens)
        return self.logits[item, before, tokens], (item, tokens)

    def reorder(self, state, index):
        return state[0][index], state[1][index]

    def score(self, item: int, sequence: list[int], penalty: float) -> float:
        """Log-probability of a sequence with its end, over its length; the start can never be drawn."""
        before, last, total = 0, START, 0.0
        for position, token in enumerate([*sequence, END]):
            logits = self.logits[item, before, last].clone()
            logits[START] = -torch.inf
            if position == 0:
                logits[END] = -torch.inf
            total += float(torch.log_softmax(logits, -1)[token])
            before, last = last, token
        return total / (len(sequence) + 1) ** penalty


def test_averaged_states_search_as_one_model_of_their_mean():
    apart, mean = Table(items=6), Table(items=3)
    mean.logits = torch.softmax(apart.logits, -1).view(3, 2, WORDS, WORDS, WORDS).mean(1).log()
    start = torch.full((3,), START)
    expected = beam_search(mean, mean.first(3), start, END, 3, 2, 5, banned=(START,))
    found = beam_search(Averaged([apart], 2), [apart.first(6)], start, END, 3, 2, 5, banned=(START,))
    assert [[h.tokens for h in item] for item in found] == [[h.tokens for h in item] for item in expected]
    for item, other in zip(found, expected, strict=True):
        assert [h.score for h in item] == pytest.approx([h.score for h in other], abs=1e-5)
    each = [Table(items=3), Table(items=3)]
    for number, table in enumerate(each):
        table.logits = apart.logits[number::2]
    again = beam_search(Averaged(each), [table.first(3) for table in each], start, END, 3, 2, 5, banned=(START,))
    assert [[h.tokens for h in item] for item in again] == [[h.tokens for h in item] for item in expected]
    alone = beam_search(apart, apart.first(6), torch.full((6,), START), END, 3, 2, 5, banned=(START,))
    assert [item[0].tokens for item in alone[::2]] != [item[0].tokens for item in found]


@pytest.mark.parametrize("penalty", [0.0, 0.7, 1.5])
def test_wide_beam_search_finds_what_exhaustive_search_finds(penalty):
    table, steps = Table(items=4), 4
    start = torch.full((4,), START)
    found = beam_search(table, table.first(4), start, END, 3**4, 3, steps, penalty, banned=(START,))
    words = [w for w in range(WORDS) if w not in (START, END)]
    sequences = [list(s) for n in range(1, steps + 1) for s in itertools.product(words, repeat=n)]
    for item, hypotheses in enumerate(found):
        scored = sorted(((table.score(item, s, penalty), s) for s in sequences), reverse=True)[:3]
        assert [h.tokens for h in hypotheses] == [s for _, s in scored]
        assert [h.score for h in hypotheses] == pytest.approx([value for value, _ in scored], abs=1e-5)


def test_narrow_beams_score_each_item_as_if_alone_and_never_better_than_wide_ones():
    table = Table(items=6, seed=3)
    together = beam_search(table, table.first(6), torch.full((6,), START), END, 2, 2, 6, banned=(START,))
    wide = beam_search(table, table.first(6), torch.full((6,), START), END, 200, 1, 6, banned=(START,))
    for item in range(6):
        state = (torch.tensor([item]), torch.zeros(1, dtype=torch.long))
        alone = beam_search(table, state, torch.tensor([START]), END, 2, 2, 6, banned=(START,))[0]
        assert alone == together[item]
        assert together[item][0].score <= wide[item][0].score + 1e-6
        assert together[item][0].score == pytest.approx(table.score(item, together[item][0].tokens, 0.7), abs=1e-5)


def test_greedy_takes_the_likeliest_token_of_every_step():
    table = Table(items=3, seed=1)
    tokens, count = sample(table, table.first(3), torch.full((3,), START), END, None, 8, banned=(START,))
    for item in range(3):
        before, last = 0, START
        for position in range(int(count[item])):
            logits = table.logits[item, before, last].clone()
            logits[[START, END] if position == 0 else [START]] = -torch.inf
            before, last = last, int(logits.argmax())
            assert tokens[item, position] == last


def test_finished_items_are_no_longer_scored():
    table = Table(items=3)
    table.logits[..., END] = 30.0  # every sequence ends after its first word
    beam_search(table, table.first(3), torch.full((3,), START), END, 2, 1, 30, 0.0, banned=(START,))
    assert table.scored == 2 * 3 * 2
    table.scored = 0
    sample(table, table.first(3), torch.full((3,), START), END, torch.full((3, 30), 0.5), 30, banned=(START,))
    assert table.scored == 2 * 3


@pytest.mark.parametrize(
    "sampling", [Sampling(), Sampling(temperature=0.5), Sampling(top_k=2), Sampling(top_p=0.6), Sampling(2.0, 3, 0.9)]
)
def test_frequencies_are_those_of_the_filtered_softmax(sampling):
    logits = torch.tensor([0.3, -torch.inf, 1.4, 0.1, -0.7])
    expected = torch.softmax(logits.double() / sampling.temperature, -1)
    order = expected.argsort(descending=True)
    if sampling.top_k:
        expected[order[sampling.top_k :]] = 0
    if sampling.top_p < 1:
        reached = expected[order].cumsum(0) - expected[order]
        expected[order[reached >= sampling.top_p]] = 0
    expected /= expected.sum()
    noise = (torch.arange(20000, dtype=torch.float64) + 0.5) / 20000
    drawn = sampling.draw(logits.expand(20000, -1), noise)
    frequency = torch.bincount(drawn, minlength=5) / 20000
    assert torch.allclose(frequency.double(), expected, atol=2e-4)
    assert sampling.draw(logits[None], torch.tensor([1 - 1e-17])) in expected.nonzero()[:, 0]
    assert sampling.draw(logits[None], torch.tensor([0.0])) in expected.nonzero()[:, 0]


def test_noise_belongs_to_the_seed_and_sampling_to_the_row():
    noise = uniform_noise([5, 9, 5], 12)
    assert torch.equal(noise[0], noise[2])
    assert not torch.equal(noise[0], noise[1])
    assert torch.equal(uniform_noise([9], 7)[0], noise[1, :7])
    table = Table(items=8, seed=2)
    seeds = list(range(8))
    together, counts = sample(
        table, table.first(8), torch.full((8,), START), END, uniform_noise(seeds, 10), 10, banned=(START,)
    )
    for item in range(8):
        state = (torch.tensor([item]), torch.zeros(1, dtype=torch.long))
        alone, count = sample(table, state, torch.tensor([START]), END, uniform_noise([item], 10), 10, banned=(START,))
        assert torch.equal(alone[0], together[item])
        assert count == counts[item]


def test_ends_are_handled_and_lengths_can_be_forced():
    table = Table(items=40, seed=4)
    noise = uniform_noise(range(40), 9)
    tokens, count = sample(table, table.first(40), torch.full((40,), START), END, noise, 9, banned=(START,))
    assert count.min() >= 1
    assert count.max() <= 9
    assert len(count.unique()) > 3
    for row, n in zip(tokens.tolist(), count.tolist(), strict=True):
        assert END not in row[:n]
        assert set(row[n:]) <= {END}
        assert START not in row
    wanted = torch.arange(40) % 9 + 1
    forced, count = sample(table, table.first(40), torch.full((40,), START), END, noise, 9, None, (START,), wanted)
    assert torch.equal(count, wanted)
    for row, n in zip(forced.tolist(), count.tolist(), strict=True):
        assert END not in row[:n]
        assert set(row[n:]) <= {END}


def test_bad_settings_say_what_is_wrong():
    for settings in ({"temperature": 0.0}, {"top_k": -1}, {"top_p": 0.0}, {"top_p": 1.5}):
        with pytest.raises(InputError, match=next(iter(settings))):
            Sampling(**settings)
    table = Table(1)
    with pytest.raises(InputError, match="beams"):
        beam_search(table, table.first(1), torch.tensor([START]), END, beams=0)


def test_the_coldest_draw_is_the_likeliest():
    logits, noise = torch.tensor([[0.1, 2.0, -torch.inf, 1.9]]).expand(64, -1), torch.linspace(0, 0.999, 64)
    for temperature in (1e-320, 1e-300, 1e-9):
        assert (Sampling(temperature).draw(logits, noise) == 1).all()


@pytest.mark.parametrize("temperature", [0.0, -1.0, float("inf"), float("nan")])
def test_a_temperature_is_a_number_above_zero(temperature):
    with pytest.raises(InputError, match=r"temperature.*must be a number above 0"):
        Sampling(temperature)
