"""Masked autoregression of snippet codes: components in closed form, flows that arrive, one batch learned by heart, no
result depends on its neighbors, bad input."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from every_system import batch_for

from motionary.corpus.batch import Batch
from motionary.errors import InputError
from motionary.language import Sentence
from motionary.nn.layers import seeded
from motionary.systems.io import Trained, build_model, load_model, save_model
from motionary.systems.masked.flow_head import FlowHead, flow
from motionary.systems.masked.masked_autoregression import MaskedAutoregression, MaskedAutoregressionConfig
from motionary.systems.masked.masked_networks import Text
from motionary.systems.masked.snippet_generator import SnippetGenerator
from motionary.systems.t2m.autoencoder import Autoencoder, AutoencoderConfig

SMALL = {
    "components": 4, "word_dim": 8, "width": 32, "num_layers": 1, "num_heads": 4, "dim_feedforward": 64, "dropout": 0.0,
    "head_width": 32, "head_blocks": 2,
}  # fmt: skip


def model(context, **settings) -> MaskedAutoregression:
    config = MaskedAutoregressionConfig(**{"snippet_width": 16, "snippet_dim": 12, **SMALL, **settings})
    with seeded(0):
        return MaskedAutoregression(config, context)


def stirred(context) -> MaskedAutoregression:
    """One whose head does not start at zero, where neither text nor noise would matter."""
    net = model(context)
    with seeded(1):
        for layer in (net.head.output, *(block.condition for block in net.head.blocks)):
            torch.nn.init.normal_(layer.weight, std=0.5)
    return net


def sentences() -> list[Sentence]:
    texts = {"a person walks": ("a", "person", "walk"), "a person jumps": ("a", "person", "jump"), "runs": ("run",)}
    return [Sentence(text, words, ("NOUN",) * len(words)) for text, words in texts.items()]


@pytest.fixture(scope="module")
def generator(context) -> SnippetGenerator:
    lengths = lambda texts, seeds, likeliest: [40 + 4 * int(s) for s in seeds]  # noqa: E731
    return SnippetGenerator(stirred(context), lengths, chunk=2)


@pytest.mark.parametrize("steps", [1, 2, 9])
def test_a_flow_to_one_code_arrives_whatever_the_steps(steps):
    """The field of a single code c is (c - x) / (1 - t), and its last Euler step ends at c."""
    start, code = torch.randn(2, 5, 3, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(flow(lambda x, time: (code - x) / (1 - time[:, None]), start, steps), code)


def test_a_head_that_says_nothing_has_the_loss_of_two_deviations():
    """E |x_1 - x_0|^2 = 2 for codes of one deviation."""
    with seeded(0):
        head, codes, told = FlowHead(6, 8, 16, 2), torch.randn(4000, 6), torch.randn(4000, 8)
    loss = head.loss(codes, told, 2, torch.Generator().manual_seed(0))
    assert float(loss.detach()) == pytest.approx(2.0, rel=0.03)


def test_components_are_the_principal_ones(context):
    """Codes of deviations 3, 2, 1 along known axes: two components keep 13/14 of the variance, scaled to a mean square
    of one."""
    with seeded(0):
        axes = torch.linalg.qr(torch.randn(12, 12))[0][:, :3]
        drawn = torch.randn(20000, 3)
    drawn = (drawn - drawn.mean(0)) / drawn.std(0)
    codes = drawn * torch.tensor([3.0, 2.0, 1.0]) @ axes.mT + 5
    net = model(context, components=2)
    assert net.take_components(codes) == pytest.approx(13 / 14, abs=2e-3)
    found = (codes - net.mean) @ net.axes / net.scale
    assert float(found.square().mean()) == pytest.approx(1, abs=1e-3)
    assert float((net.axes.mT @ axes).abs().diagonal().min()) > 0.99
    three = model(context, components=3)
    assert three.take_components(codes) == pytest.approx(1, abs=1e-6)
    back = (codes - three.mean) @ three.axes @ three.axes.mT + three.mean
    torch.testing.assert_close(back, codes, atol=1e-3, rtol=0)


def test_all_components_are_the_autoencoders_codes(context, batch):
    with seeded(0):
        codec = Autoencoder(AutoencoderConfig(16, 12), context).eval()
    net = model(context, components=99).take_snippets(codec.encoder, codec.decoder).eval()
    codes, count = codec.encode(batch.motion, batch.frames), batch.frames // 4
    valid = torch.arange(codes.shape[1]) < count[:, None]
    net.take_components(codes[valid].detach())
    found = net.encode(batch.motion, batch.frames)
    assert (found[~valid] == 0).all()
    torch.testing.assert_close(net.decode(found, count), codec.decode(codes, count), atol=1e-3, rtol=1e-3)


def test_a_batch_is_learned_by_heart(context):
    net = model(context, text_dropout=0.0, guidance=1.0, word_dropout=0.0).train()
    batch, rng = batch_for(context, net), torch.Generator().manual_seed(0)
    optimizer = torch.optim.AdamW(net.parameters(), lr=5e-3)
    for step in range(600):
        optimizer.param_groups[0]["lr"] = 5e-3 * (1 - step / 600)
        net.loss(batch, step / 600, rng)[0].backward()
        optimizer.step()
        optimizer.zero_grad()
    assert net.eval().validate(batch)["loss"] < 0.4  # 2 at first
    # From all masked and from the text alone, its codes return.
    valid = torch.arange(8) < batch.token_count[:, None]
    text = Text(batch.words, batch.tags, batch.word_count, batch.states, batch.state_count)
    memory = net.text(text, torch.zeros(6, dtype=torch.bool))
    embedded = net.embed(batch.tokens, torch.zeros_like(valid))
    told = net.reader(embedded, batch.token_count, memory, net.reader.read(memory))[valid]
    start = torch.randn(len(told), 4, generator=rng)
    with torch.no_grad():
        made = flow(lambda x, time: net.head(x, time, told), start, 32)
    assert float((made - batch.tokens[valid]).square().mean()) < 0.15  # of codes whose mean square is 1


def test_padding_and_texts_of_something_else_are_not_read(context):
    net = stirred(context).eval()
    batch = batch_for(context, net)
    values = []
    for textless in (False, True):
        batch.textless = torch.full((6,), textless)
        for states in (batch.states, 1 - batch.states):
            values.append(net.validate(Batch(**vars(batch) | {"states": states}))["loss"])
    assert values[0] != values[1]
    assert values[2] == values[3]
    before = net.validate(batch)["loss"]
    batch.tokens = batch.tokens + 1e3 * (torch.arange(8) >= batch.token_count[:, None])[..., None]
    torch.testing.assert_close(net.validate(batch)["loss"], before)


def test_generation_depends_on_its_own_text_seed_and_length_alone(generator):
    texts = sentences()
    together = generator.generate(texts, [3, 4, 5], [48, 35, 80])
    assert [len(m) for m in together] == [48, 35, 80]
    alone = generator.generate(texts[1:2], [4], [35])[0]
    np.testing.assert_allclose(alone, together[1], atol=1e-5)
    for other in (generator.generate(texts[1:2], [9], [35])[0], generator.generate(texts[:1], [4], [35])[0]):
        assert np.abs(other - alone).max() > 1e-3
    greedy = [generator.generate(texts[:1], [4], [36], greedy=True, temperature=t)[0] for t in (0.5, 2.0)]
    np.testing.assert_array_equal(*greedy)
    assert [len(m) for m in generator.generate(texts, [0, 1, 2])] == [40, 44, 48]  # of the lengths' own draw
    assert generator.generate([], []) == []


def test_guidance_of_zero_does_not_read_the_text(generator):
    texts = sentences()[:2]
    blind = [generator.generate([text], [0], [32], guidance=0.0)[0] for text in texts]
    np.testing.assert_allclose(*blind, atol=1e-4)
    alone, both = (generator.generate(texts[:1], [0], [32], guidance=g)[0] for g in (1.0, 1.0 + 1e-6))
    np.testing.assert_allclose(alone, both, atol=1e-3)  # one pass, or two of which one counts for nothing


def test_known_codes_stay_and_the_others_are_made(generator):
    rng = np.random.default_rng(0)
    tokens = [rng.standard_normal((n, 4)).astype(np.float32) for n in (12, 7, 9)]
    known = [rng.random(len(codes)) < 0.5 for codes in tokens]
    told = [None, sentences()[0], sentences()[1]]
    made = generator.infill(tokens, known, told, [0, 1, 2])
    for codes, fixed, result in zip(tokens, known, made, strict=True):
        assert result.shape == codes.shape
        np.testing.assert_array_equal(result[fixed], codes[fixed])
        assert np.abs(result - codes)[~fixed].min() > 1e-6
    # What stands at unknown places is not read, nor are the other motions of the call.
    scrambled = [np.where(fixed[:, None], codes, np.nan) for codes, fixed in zip(tokens, known, strict=True)]
    for a, b in zip(made, generator.infill(scrambled, known, told, [0, 1, 2]), strict=True):
        np.testing.assert_array_equal(a, b)
    alone = generator.infill(tokens[1:2], known[1:2], told[1:2], [1])[0]
    np.testing.assert_allclose(alone, made[1], atol=1e-5)
    # What is known is read: other known codes, other codes between them.
    moved = generator.infill([tokens[0] + 1], known[:1], [None], [0])[0]
    assert np.abs(moved - made[0])[~known[0]].max() > 1e-3
    everything = [np.ones(len(codes), bool) for codes in tokens]
    for a, b in zip(tokens, generator.infill(tokens, everything, told, [0, 1, 2]), strict=True):
        np.testing.assert_array_equal(a, b)


def test_without_a_text_guidance_changes_nothing(generator):
    empty, unknown = [np.zeros((6, 4), np.float32)], [np.zeros(6, bool)]
    a, b = (generator.infill(empty, unknown, [None], [0], guidance=g)[0] for g in (1.0, 7.0))
    np.testing.assert_array_equal(a, b)


def test_codes_come_from_motions_and_go_back_as_the_models_own(generator, batch):
    motions = [batch.motion[i, : batch.frames[i]].numpy() for i in range(4)]
    tokens = generator.encode(motions)
    assert [codes.shape for codes in tokens] == [(8, 4), (6, 4), (4, 4), (7, 4)]
    expected = generator.model.decode(torch.from_numpy(tokens[1])[None])[0].detach().numpy()
    np.testing.assert_allclose(generator.decode(tokens)[1], expected, atol=1e-4)


@pytest.mark.parametrize(
    ("codes", "known", "message"),
    [
        (np.zeros((4, 3)), np.zeros(4, bool), r"tokens\[0\]: \(4, 3\): must be \(S, 4\) with S in 1..49"),
        (np.zeros((50, 4)), np.zeros(50, bool), r"tokens\[0\]: \(50, 4\): must be"),
        (np.zeros((0, 4)), np.zeros(0, bool), r"tokens\[0\]: \(0, 4\): must be"),
        (np.zeros((4, 4)), np.zeros(5, bool), r"known\[0\]: .*must be bool \(4,\)"),
        (np.full((4, 4), np.nan), np.ones(4, bool), r"tokens\[0\]: not finite: known codes must be finite"),
    ],
)
def test_codes_that_no_model_has_are_one_line(generator, codes, known, message):
    with pytest.raises(InputError, match=message):
        generator.infill([codes], [known], [None], [0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"temperature": 0.0}, "temperature: 0.0: must be above 0"),
        ({"guidance": -1.0}, "guidance: -1.0: must be in 0..1000"),
        ({"frames": [3]}, "frames: 3: must be a whole number from 4 to 196"),
        ({"frames": [200]}, "frames: 200: must be a whole number"),
    ],
)
def test_bad_requests_are_one_line(generator, options, message):
    with pytest.raises(InputError, match=message):
        generator.generate(sentences()[:1], [0], **{"frames": [40], **options})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"num_heads": 5}, "masked_autoregression.num_heads: 5: must divide width, 32"),
        ({"text_dropout": 0.0}, "masked_autoregression.text_dropout: 0.0: must be above 0"),
        ({"components": 0}, "masked_autoregression.components: 0: must be"),
        ({"head_width": 33}, "masked_autoregression.head_width: 33: must be even"),
        ({"flow_steps": 0}, "masked_autoregression.flow_steps: 0: must be"),
    ],
)
def test_bad_settings_are_one_line(settings, message):
    with pytest.raises(InputError, match=message):
        MaskedAutoregressionConfig(**{"snippet_dim": 12, **SMALL, **settings})


def test_it_is_built_on_the_autoencoder_and_returns_from_disk(context, tmp_path):
    with seeded(0):
        codec = Autoencoder(AutoencoderConfig(16, 12), context)
    save_model(tmp_path / "autoencoder", "autoencoder", codec, context)
    net = build_model("masked_autoregression", SMALL, context, Trained(tmp_path)).eval()
    net.take_components(torch.randn(100, 12, generator=torch.Generator().manual_seed(0)))
    save_model(tmp_path / "masked_autoregression", "masked_autoregression", net, context)
    back, batch = load_model(tmp_path / "masked_autoregression"), batch_for(context, net)
    assert isinstance(back, MaskedAutoregression)
    assert torch.equal(net.validate(batch)["loss"], back.validate(batch)["loss"])
    torch.testing.assert_close(net.decode(batch.tokens), back.decode(batch.tokens))
    torch.testing.assert_close(back.encoder.output.weight, codec.encoder.output.weight)


def after_decoding(context, **weights) -> dict[str, torch.Tensor]:
    """The terms of the decoder's loss on a batch that it has learned from."""
    net = model(context, components=12, decoder_items=6, decoder_noise=0.0, **weights).train()
    batch, rng = batch_for(context, net), torch.Generator().manual_seed(0)
    with torch.no_grad():
        net.take_components(net.encoder(batch.motion, batch.frames).flatten(0, 1))
    optimizer = torch.optim.AdamW(net.decoder.parameters(), lr=3e-3)
    for _ in range(80):
        net._decoding_loss(batch, rng)[0].backward()
        torch.nn.utils.clip_grad_norm_(net.decoder.parameters(), 1.0)  # as the loop does
        optimizer.step()
        optimizer.zero_grad()
    return net.validate(batch)


def test_each_weight_of_the_decoders_loss_brings_down_what_it_names(context):
    off = {"velocity_weight": 0.0, "acceleration_weight": 0.0, "contact_weight": 0.0}
    without = after_decoding(context, **off)
    for weight, term in zip(off, ("velocity", "acceleration", "sliding"), strict=True):
        assert after_decoding(context, **{**off, weight: 3.0})[term] < 0.9 * without[term], term


def test_the_encoder_stays_and_early_stopping_watches_the_flow(context):
    still = model(context)
    assert not any(p.requires_grad for p in (*still.encoder.parameters(), *still.decoder.parameters()))
    net = model(context, decoder_items=6)
    assert not any(p.requires_grad for p in net.encoder.parameters())
    values = net.validate(batch_for(context, net))
    assert torch.equal(values["loss"], values["flow"])


def test_flow_and_decoder_do_not_pull_at_each_other(context):
    net = model(context, decoder_items=2).train()
    batch = batch_for(context, net)
    net._flow_loss(batch, torch.Generator().manual_seed(0)).backward()
    assert all(p.grad is None for p in net.decoder.parameters())
    net.zero_grad()
    net._decoding_loss(batch, torch.Generator().manual_seed(0))[0].backward()
    touched = {name.split(".")[0] for name, p in net.named_parameters() if p.grad is not None}
    assert touched == {"decoder"}


def test_of_a_batch_the_decoder_reads_as_many_items_as_it_is_told(context):
    """And every item has its turn: batches are sorted by length, so that the first are always the shortest."""
    net = model(context, decoder_items=2, decoder_noise=0.0).eval()
    batch, read = batch_for(context, net), []

    def value(seed: int) -> float:
        with torch.no_grad():
            return net._decoding_loss(batch, torch.Generator().manual_seed(seed))[1]["reconstruction"].item()

    for seed in range(12):
        before, items = value(seed), set()
        for item in range(len(batch.motion)):
            batch.motion[item] += 1
            items |= {item} if value(seed) != before else set()
            batch.motion[item] -= 1
        assert len(items) == 2
        read.append(items)
    assert set().union(*read) == set(range(len(batch.motion)))
