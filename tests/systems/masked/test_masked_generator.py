"""The generator: one batch learned by heart, known tokens kept, no result depends on its neighbors, bad input."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from every_system import batch_for

from motionary.corpus.batch import Batch
from motionary.errors import InputError
from motionary.language import Sentence
from motionary.nn.layers import seeded
from motionary.nn.residual_quantizer import NO_CODE
from motionary.systems.io import Trained, build_model, load_model, save_model
from motionary.systems.masked.masked_generator import MaskedGenerator, MaskedGeneratorConfig
from motionary.systems.masked.masked_networks import Text
from motionary.systems.masked.motion_filler import MotionFiller
from motionary.systems.masked.residual_tokenizer import ResidualTokenizer, ResidualTokenizerConfig

CODEC = ResidualTokenizerConfig(codebook_size=16, num_quantizers=3, code_dim=8, width=16, fine_width=8)
SMALL = {
    "word_dim": 8, "width": 32, "num_layers": 1, "detail_layers": 1, "num_heads": 4, "dim_feedforward": 64,
    "dropout": 0.0,
}  # fmt: skip


def codec(context) -> ResidualTokenizer:
    with seeded(0):
        model = ResidualTokenizer(CODEC, context)
        model.quantizer.start(torch.randn(200, 8), torch.Generator().manual_seed(0))
    return model.eval()


def model(context, **settings) -> MaskedGenerator:
    with seeded(0):
        config = MaskedGeneratorConfig(16, 8, 3, **{**SMALL, **settings})
        return MaskedGenerator(config, context).take_codebooks(codec(context).quantizer.codebooks())


def sentences() -> list[Sentence]:
    texts = {"a person walks": ("a", "person", "walk"), "a person jumps": ("a", "person", "jump"), "runs": ("run",)}
    return [Sentence(text, words, ("NOUN",) * len(words)) for text, words in texts.items()]


@pytest.fixture(scope="module")
def filler(context) -> MotionFiller:
    lengths = lambda texts, seeds, likeliest: [40 + 4 * int(s) for s in seeds]  # noqa: E731
    return MotionFiller(model(context), codec(context), lengths, chunk=2)


@pytest.mark.parametrize(("detail", "layers"), [("residual", 0), ("residual", 2), ("flow", 0), ("flow", 2)])
def test_a_batch_is_learned_by_heart(context, detail, layers):
    settings = {"label_smoothing": 0.0, "text_dropout": 0.0, "guidance": 1.0, "detail_guidance": 1.0, "detail": detail}
    settings["told_layers"] = layers
    net = model(context, **settings, word_dropout=0.0, random_share=0.0, kept_share=0.0).train()
    batch, rng = batch_for(context, net), torch.Generator().manual_seed(0)
    batch.tokens = torch.randint(16, batch.tokens.shape, generator=rng)
    # Codes that their entries' sum tells: each layer lies within a tenth of the one before.
    with seeded(0):
        net.take_codebooks(net.codebooks / net.codebooks.std() * torch.tensor([1.0, 0.3, 0.03])[:, None, None])
    optimizer = torch.optim.AdamW(net.parameters(), lr=5e-3)
    for step in range(200):
        net.loss(batch, step / 200, rng)[0].backward()
        optimizer.step()
        optimizer.zero_grad()
    values = net.eval().validate(batch)
    assert values["plan_top1"] > 0.95
    assert values["detail_top1"] > 0.95 if detail == "residual" else values["detail_flow"] < 0.8  # 2 at first
    # From all masked and from the text alone, the same tokens return.
    from motionary.systems.masked.mask_decoding import Drawing, draws_needed, fill

    text = Text(batch.words, batch.tags, batch.word_count, batch.states, batch.state_count)
    nothing = torch.zeros(6, 8, dtype=torch.bool)
    noise, told = torch.rand(6, draws_needed(net), generator=rng), torch.ones(6, dtype=torch.bool)
    made = fill(net, text, told, batch.tokens * 0, nothing, batch.token_count, noise, Drawing(None, 1.0, None, 1.0))
    valid = torch.arange(8) < batch.token_count[:, None]
    if layers:
        assert (made[valid][:, layers:] == NO_CODE).all()
    told = slice(2 if detail == "flow" or layers else None)  # the last layer is a hundredth of what the flow tells
    assert (made[valid][:, told] == batch.tokens[valid][:, told]).float().mean() > 0.95
    assert (made[~valid] == 0).all()


def test_a_text_that_is_of_something_else_is_not_read(context):
    net = model(context).eval()
    batch = batch_for(context, net)
    batch.tokens = batch.tokens % 16
    values = []
    for textless in (False, True):
        batch.textless = torch.full((len(batch.clip),), textless)
        for states in (batch.states, 1 - batch.states):
            values.append(net.validate(Batch(**vars(batch) | {"states": states}))["loss"])
    assert values[0] != values[1]
    assert values[2] == values[3]


def test_loss_is_blind_to_padding(context):
    net = model(context).eval()
    batch = batch_for(context, net)
    batch.tokens = batch.tokens % 16
    before, tags = net.validate(batch)["loss"], batch.tags
    assert tags is not None
    batch.tokens = torch.nn.functional.pad(batch.tokens, (0, 0, 0, 3), value=7)
    batch.words = torch.nn.functional.pad(batch.words, (0, 2))
    batch.tags = torch.nn.functional.pad(tags, (0, 2))
    batch.states = torch.nn.functional.pad(batch.states, (0, 0, 0, 2), value=3.0)
    batch.states[:, -2:] = 0
    # Masks are drawn for every place, so those of a longer batch are others: compare what does not draw.
    text = Text(batch.words, batch.tags, batch.word_count, batch.states, batch.state_count)
    short = Text(text.words[:, :-2], tags, text.word_count, text.states[:, :-2], text.state_count)
    all_told = torch.zeros(6, dtype=torch.bool)
    logits = []
    for read, tokens in ((text, batch.tokens), (short, batch.tokens[:, :-3])):
        memory = net.text(read, all_told)
        found = net.plan(tokens[..., 0], batch.token_count, memory, net.plan.reader.read(memory))[:, :8]
        logits.append(found[torch.arange(8) < batch.token_count[:, None]])
    torch.testing.assert_close(*logits, rtol=1e-4, atol=1e-4)
    assert torch.isfinite(before)


def test_generation_depends_on_its_own_text_seed_and_length_alone(filler):
    texts = sentences()
    together = filler.generate(texts, [3, 4, 5], [48, 35, 80])
    assert [len(m) for m in together] == [48, 35, 80]
    alone = filler.generate(texts[1:2], [4], [35])[0]
    np.testing.assert_allclose(alone, together[1], atol=1e-4)
    other = filler.generate(texts[1:2], [9], [35])[0]
    assert np.abs(other - alone).max() > 1e-3
    greedy = [filler.generate(texts[:1], [seed], [36], greedy=True)[0] for seed in (1, 2)]
    np.testing.assert_array_equal(*greedy)
    assert [len(m) for m in filler.generate(texts, [0, 1, 2])] == [40, 44, 48]  # of the lengths' own draw
    assert filler.generate([], []) == []


def test_known_tokens_stay_and_the_others_are_made(filler):
    rng = np.random.default_rng(0)
    tokens = [rng.integers(0, 16, (n, 3)) for n in (12, 7, 9)]
    known = [rng.random(len(codes)) < 0.5 for codes in tokens]
    told = [None, sentences()[0], sentences()[1]]
    made = filler.infill(tokens, known, told, [0, 1, 2])
    for codes, fixed, result in zip(tokens, known, made, strict=True):
        np.testing.assert_array_equal(result[fixed], codes[fixed])
        assert result.shape == codes.shape
        assert result.min() >= 0
        assert result.max() < 16
    # What stands at unknown places is not read.
    scrambled = [np.where(fixed[:, None], codes, 99) for codes, fixed in zip(tokens, known, strict=True)]
    for a, b in zip(made, filler.infill(scrambled, known, told, [0, 1, 2]), strict=True):
        np.testing.assert_array_equal(a, b)
    everything = [np.ones(len(codes), bool) for codes in tokens]
    for a, b in zip(tokens, filler.infill(tokens, everything, told, [0, 1, 2]), strict=True):
        np.testing.assert_array_equal(a, b)


def test_layers_that_are_not_told_stay_where_they_are_known(context):
    lengths = lambda texts, seeds, likeliest: [32] * len(seeds)  # noqa: E731
    for layers in (1, 2):
        some = MotionFiller(model(context, told_layers=layers), codec(context), lengths)
        rng = np.random.default_rng(0)
        tokens, known = [rng.integers(0, 16, (9, 3))], [np.arange(9) < 4]
        (made,) = some.infill(tokens, known, sentences()[:1], [0])
        np.testing.assert_array_equal(made[:4], tokens[0][:4])
        assert (made[4:, layers:] == NO_CODE).all()
        assert made[4:, :layers].min() >= 0
        # A layer without a code adds nothing: the motion is that of the layers that are told.
        (all_made,) = some.infill(tokens, [np.zeros(9, bool)], sentences()[:1], [0])
        alone = some.decode([all_made[:, :layers]])[0]
        np.testing.assert_allclose(some.decode([all_made])[0], alone, atol=1e-6)
        again = some.infill([made], [np.ones(9, bool)], [None], [1])[0]
        np.testing.assert_array_equal(again, made)
        with pytest.raises(InputError, match=r"tokens\[0\]: -1: must be codes in 0..15"):
            some.infill([np.full((4, 3), NO_CODE)], [np.ones(4, bool)], [None], [0])
        with pytest.raises(InputError, match=r"tokens\[0\]: 16: must be codes in -1..15"):
            some.infill([np.insert(made[:, :-1], 2, 16, 1)], [np.ones(9, bool)], [None], [0])


def test_encoding_and_decoding_are_the_tokenizers(filler, batch):
    motions = [batch.motion[i, : batch.frames[i]].numpy() for i in range(4)]
    tokens = filler.encode(motions)
    assert [len(codes) for codes in tokens] == [8, 6, 4, 7]
    decoded = filler.decode(tokens)
    expected = filler.tokenizer.decode(torch.from_numpy(tokens[1])[None])[0].detach().numpy()
    np.testing.assert_allclose(decoded[1], expected, atol=1e-4)


def test_guidance_without_a_text_changes_nothing(filler):
    empty, unknown = [np.zeros((6, 3), np.int64)], [np.zeros(6, bool)]
    a, b = (filler.infill(empty, unknown, [None], [0], guidance=g)[0] for g in (1.0, 7.0))
    np.testing.assert_array_equal(a, b)
    with_text = [filler.infill(empty, unknown, sentences()[:1], [0], guidance=g)[0] for g in (0.0, 9.0)]
    assert (with_text[0] != with_text[1]).any()


@pytest.mark.parametrize(
    ("codes", "known", "message"),
    [
        (np.zeros((4, 2), int), np.zeros(4, bool), r"tokens\[0\]: \(4, 2\): must be \(S, 3\) with S in 1..49"),
        (np.zeros((50, 3), int), np.zeros(50, bool), r"tokens\[0\]: \(50, 3\): must be"),
        (np.zeros((0, 3), int), np.zeros(0, bool), r"tokens\[0\]: \(0, 3\): must be"),
        (np.zeros((4, 3), int), np.zeros(5, bool), r"known\[0\]: .*must be bool \(4,\)"),
        (np.full((4, 3), 16), np.ones(4, bool), r"tokens\[0\]: 16: must be codes in 0..15"),
    ],
)
def test_tokens_that_no_model_has_are_one_line(filler, codes, known, message):
    with pytest.raises(InputError, match=message):
        filler.infill([codes], [known], [None], [0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"temperature": 0.0}, "temperature"),
        ({"top_p": 2.0}, "top_p"),
        ({"guidance": -1.0}, "guidance"),
        ({"beams": 2}, "beams: 2: unknown option"),
        ({"frames": [3]}, "frames: 3: must be a whole number from 4 to 196"),
        ({"frames": [200]}, "frames: 200: must be a whole number"),
    ],
)
def test_bad_requests_are_one_line(filler, options, message):
    with pytest.raises(InputError, match=message):
        filler.generate(sentences()[:1], [0], **{"frames": [40], **options})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"num_heads": 5}, "masked_generator.num_heads: 5: must divide width, 32"),
        ({"text_dropout": 0.0}, "masked_generator.text_dropout: 0.0: must be above 0"),
        ({"random_share": 0.6, "kept_share": 0.6}, "masked_generator.random_share"),
        ({"iterations": 0}, "masked_generator.iterations"),
        ({"told_layers": 4}, "masked_generator.told_layers: 4: must be"),
        ({"width": 33, "num_heads": 3}, "masked_generator.width: 33: must be even"),
    ],
)
def test_bad_settings_are_one_line(settings, message):
    with pytest.raises(InputError, match=message):
        MaskedGeneratorConfig(16, 8, 3, **{**SMALL, **settings})


def test_it_is_built_on_its_codec_and_returns_from_disk(context, tmp_path):
    save_model(tmp_path / "residual_tokenizer", "residual_tokenizer", codec(context), context)
    net = build_model("masked_generator", SMALL, context, Trained(tmp_path)).eval()
    assert dataclasses.asdict(net.config) | {"num_quantizers": 3, "codebook_size": 16, "code_dim": 8} == (
        dataclasses.asdict(net.config)
    )
    save_model(tmp_path / "masked_generator", "masked_generator", net, context)
    back = load_model(tmp_path / "masked_generator")
    batch = batch_for(context, net)
    batch.tokens = batch.tokens % 16
    assert isinstance(back, MaskedGenerator)
    assert torch.equal(net.validate(batch)["loss"], back.validate(batch)["loss"])
    torch.testing.assert_close(back.codebooks, codec(context).quantizer.codebooks())


def test_one_layer_needs_no_detail(context):
    with seeded(0):
        net = MaskedGenerator(MaskedGeneratorConfig(16, 8, 1, **SMALL), context)
    batch = batch_for(context, net)
    batch.tokens = batch.tokens % 16
    _, terms = net.loss(batch, 0.5, torch.Generator().manual_seed(0))
    assert "detail_nll" not in terms
