"""The flow of the detail: closed-form noise, a straight field arrives, known places are kept, sums fall to codes."""

from __future__ import annotations

import pytest
import torch

from motionary.nn.layers import seeded
from motionary.systems.masked.flow_detail import FlowDetail, codes_of, normal_from
from motionary.systems.masked.masked_networks import TokenReader


def build(dim: int = 6, width: int = 8) -> FlowDetail:
    with seeded(0):
        return FlowDetail(dim, TokenReader(width, 2, 16, 1, 0.0), width)


def draws(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


def test_uniform_numbers_become_normal_ones():
    found = normal_from(torch.tensor([0.5, 0.975, 0.025, 0.0, 1.0], dtype=torch.float64))
    torch.testing.assert_close(
        found[:3], torch.tensor([0.0, 1.959964, -1.959964], dtype=torch.float64), atol=1e-6, rtol=0
    )
    assert found[3:].isfinite().all()


def test_scales_are_those_of_the_base_and_of_the_sum():
    books, net = torch.stack([3 * draws(500, 6), draws(500, 6, seed=1), draws(500, 6, seed=2)]), build()
    net.take_codebooks(books)
    torch.testing.assert_close(net.scale, torch.tensor([3.0, 2**0.5]), rtol=0.05, atol=0)


@pytest.mark.parametrize("steps", [1, 7])
def test_a_straight_field_arrives_whatever_the_steps(steps):
    net, entries, start = build(), draws(2, 5, 3, 6), draws(2, 5, 6, seed=1)
    net.scale.copy_(torch.tensor([2.0, 4.0]))
    wanted = entries[:, :, 1:].sum(2)
    seen = []

    def velocity(x: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        seen.append((x, float(time)))
        return wanted / 4 - start

    found = net.draw(velocity, entries, torch.zeros(2, 5, dtype=torch.bool), start, steps)
    torch.testing.assert_close(found, wanted)
    torch.testing.assert_close(seen[0][0], torch.cat((entries[:, :, 0] / 2, start), -1))
    assert [time for _, time in seen] == pytest.approx([step / steps for step in range(steps)])


def test_known_places_stay_on_their_way():
    net, entries, start = build(), draws(1, 4, 2, 6), draws(1, 4, 6, seed=1)
    known, paths = torch.tensor([[True, False, False, True]]), []

    def velocity(x: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        paths.append((x[..., 6:], time))
        return torch.full_like(start, 100.0)

    net.draw(velocity, entries, known, start, 4)
    for x, time in paths:
        torch.testing.assert_close(x[known], torch.lerp(start, entries[:, :, 1], time)[known])
        if time > 0:
            assert (x[~known] > 10).all()


def test_the_loss_is_that_of_the_velocity_and_blind_to_padding():
    """With its last layer at zero the network says 0: the loss is the mean square of x_1 - x_0, of variance 2."""
    from motionary.systems.masked.masked_networks import Memory

    net, items, length = build(), 64, 40
    memory = Memory(draws(items, 3, 8), torch.ones(items, 3, dtype=torch.bool), draws(items, 8))
    entries, valid = draws(items, length, 2, 6, seed=3), torch.arange(length) < torch.full((items, 1), 30)
    loss = net.loss(entries, valid, memory, torch.Generator().manual_seed(0))
    assert float(loss.detach()) == pytest.approx(2.0, rel=0.03)
    entries[~valid] = 1e4
    torch.testing.assert_close(net.loss(entries, valid, memory, torch.Generator().manual_seed(0)), loss)
    torch.nn.init.normal_(net.output.weight)
    changed = net.loss(entries, valid, memory, torch.Generator().manual_seed(0))
    entries[~valid] = 7.0
    torch.testing.assert_close(net.loss(entries, valid, memory, torch.Generator().manual_seed(0)), changed)


def test_sums_fall_to_their_codes_layer_by_layer():
    books = torch.stack([torch.eye(4) * 10, torch.eye(4), torch.eye(4) / 10])
    codes = torch.tensor([[0, 1, 2], [3, 3, 3], [2, 0, 1]])
    sums = sum(books[i][codes[:, i]] for i in range(3))
    assert torch.equal(codes_of(sums + 0.01 * draws(3, 4), books), codes)
