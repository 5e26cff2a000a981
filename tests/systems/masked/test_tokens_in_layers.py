"""TM2T's systems on tokens in layers: captions read the sum of their embeddings, text2token writes the base."""

from __future__ import annotations

import pytest
import torch
from every_system import SMALL, batch_for

from motionary.errors import InputError
from motionary.nn.layers import seeded
from motionary.systems.io import Trained, build_model, save_model
from motionary.systems.masked.residual_tokenizer import ResidualTokenizer, ResidualTokenizerConfig

READER = {key: SMALL[key] for key in ("width", "num_layers", "dim_feedforward", "num_heads")}


@pytest.fixture(scope="module")
def trained(context, tmp_path_factory) -> Trained:
    """A folder with a residual tokenizer of three layers, in the tokenizer's role."""
    folder = tmp_path_factory.mktemp("models")
    config = ResidualTokenizerConfig(codebook_size=16, num_quantizers=3, code_dim=8, width=16, fine_width=8)
    with seeded(0):
        codec = ResidualTokenizer(config, context)
        codec.quantizer.start(torch.randn(200, 8), torch.Generator().manual_seed(0))
    save_model(folder / "residual_tokenizer", "residual_tokenizer", codec, context)
    return Trained(folder, names={"tokenizer": "residual_tokenizer"})


def reader(context, trained, layers: int, **more):
    settings = {**READER, "tokenizer": "residual_tokenizer", "token_layers": layers, "dropout": 0.0, **more}
    with seeded(0):
        return build_model("motion2text", settings, context, trained).eval()


def layered(context, model):
    batch = batch_for(context, model)
    batch.tokens = torch.randint(16, (6, 8, 3), generator=torch.Generator().manual_seed(1))
    batch.tokens[torch.arange(8) >= batch.token_count[:, None]] = 0
    return batch


def test_captions_read_the_sum_of_the_layers(context, trained):
    model = reader(context, trained, 3, start_from_codebook=True)
    batch = layered(context, model)
    source, mask = model.embed_tokens(batch.tokens, batch.token_count)
    assert source.shape == (6, 10, 16)
    expected = sum(model.source.weight[batch.tokens[0, 4, layer] + 16 * layer] for layer in range(3))
    torch.testing.assert_close(source[0, 5], expected)
    assert torch.equal(mask.sum(1), batch.token_count + 2)
    other = batch.tokens.clone()
    other[..., 2] = (other[..., 2] + 1) % 16  # the last layer is heard
    before = model.validate(batch)["loss"]
    batch.tokens = other
    assert model.validate(batch)["loss"] != before
    assert torch.isfinite(model.train().loss(batch, 0.5, torch.Generator())[0])


def test_one_layer_is_the_base_alone(context, trained):
    model = reader(context, trained, 1)
    batch = layered(context, model)
    with_layers = model.validate(batch)["loss"]
    batch.tokens = batch.tokens[..., 0]
    assert torch.equal(model.validate(batch)["loss"], with_layers)


def test_text2token_writes_the_base(context, trained):
    settings = {"tokenizer": "residual_tokenizer", "width": 16, "text_width": 8, "word_dim": 8, "max_tokens": 12}
    with seeded(0):
        model = build_model("text2token", settings, context, trained).eval()
    batch = layered(context, model)
    with_layers = model.validate(batch)["loss"]
    batch.tokens = batch.tokens[..., 0]
    assert torch.equal(model.validate(batch)["loss"], with_layers)


def test_more_layers_than_there_are_is_one_line(context, trained):
    with pytest.raises(InputError, match=r"motion2text.token_layers: 4: must be at most the tokenizer's, 3"):
        reader(context, trained, 4)
