"""What is masked in training: the cosine schedule, spans of every kind, never padding, never nothing."""

from __future__ import annotations

import pytest
import torch

from motionary.systems.masked.masking import corrupted, masked_counts, scattered, spans, training_mask

COUNT = torch.tensor([1, 2, 5, 12] * 50)
VALID = torch.arange(12) < COUNT[:, None]


def draws(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def test_the_schedule_is_a_cosine():
    ten = torch.tensor([10])
    assert [int(masked_counts(ten, k / 4)) for k in range(5)] == [10, 9, 7, 3, 0]


@pytest.mark.parametrize("made", [scattered, spans, lambda *a: training_mask(a[0], a[1], 0.5, a[2])])
def test_something_is_masked_and_never_padding(made):
    hidden = made(COUNT, 12, draws())
    assert hidden.any(1).all()
    assert not (hidden & ~VALID).any()


def test_shares_follow_the_cosine():
    count = torch.full((4000,), 12)
    share = scattered(count, 12, draws()).float().mean()
    assert abs(float(share) - 2 / torch.pi) < 0.05  # the mean of a cosine; floors and the least of one even out


def test_spans_are_whole_and_of_every_kind():
    count = torch.full((400,), 12)
    hidden = spans(count, 12, draws())
    edges = hidden.float().diff(dim=1).abs().sum(1)
    assert (edges <= 2).all()
    first, last = hidden[:, 0], hidden[:, -1]
    for kind in (first & last, first & ~last, ~first & last, ~first & ~last):
        assert 0.1 < kind.float().mean() < 0.5


def test_hidden_codes_are_masked_changed_or_kept():
    codes, hidden = torch.randint(50, (200, 12), generator=draws()), torch.rand(200, 12, generator=draws(1)) < 0.5
    shown = corrupted(codes, hidden, 50, 0.1, 0.2, draws(2))
    assert torch.equal(shown[~hidden], codes[~hidden])
    inside = shown[hidden]
    assert abs((inside == 50).float().mean() - 0.7) < 0.05
    assert abs((inside == codes[hidden]).float().mean() - 0.2) < 0.05
    assert torch.equal(corrupted(codes, hidden, 50, 0.0, 0.0, draws(2))[hidden], torch.full_like(inside, 50))
