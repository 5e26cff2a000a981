"""Networks ask the codec for its columns: on a codec that keeps HumanML3D's groups elsewhere they do the same."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from motionary.corpus.batches import Batch
from motionary.corpus.context import Context
from motionary.features import CODECS, HumanML3D, codec, columns, other_columns
from motionary.motion import Motion, Skeleton
from motionary.nn.layers import seeded
from motionary.systems.judges.evaluator import Evaluator, EvaluatorConfig
from motionary.systems.judges.style_evaluator import StyleEvaluator, StyleEvaluatorConfig
from motionary.systems.stylization.global_motion import GlobalMotion, GlobalMotionConfig
from motionary.systems.stylization.latents import Latents, LatentsConfig
from motionary.systems.t2m.autoencoder import Autoencoder, AutoencoderConfig
from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

# Neither the root's velocities nor the foot contacts stand together or at an end.
ORDER = ("velocities", "root_linear", "contacts", "positions", "root_height", "rotations", "root_angular")


class Shuffled:
    """HumanML3D with its groups of columns in another order."""

    def __init__(self, skeleton: Skeleton):
        self.skeleton, self.plain = skeleton, HumanML3D(skeleton)
        self.dim, self.slices, start = self.plain.dim, {}, 0
        for name in ORDER:
            size = self.plain.slices[name].stop - self.plain.slices[name].start
            self.slices[name] = slice(start, start + size)
            start += size
        # Column i here is column places[i] of HumanML3D.
        self.places = np.concatenate([np.arange(self.dim)[self.plain.slices[name]] for name in ORDER])
        self.back = np.argsort(self.places)

    def encode(self, motion: Motion) -> np.ndarray:
        return self.plain.encode(motion)[:, self.places]

    def decode(self, features: np.ndarray, rotations: bool = False, fps: float = 20.0) -> Motion:
        return self.plain.decode(np.asarray(features)[:, self.back], rotations, fps)

    def root_path(self, features: torch.Tensor) -> torch.Tensor:
        return self.plain.root_path(features[..., self.back])


@pytest.fixture
def shuffled(context, monkeypatch) -> Context:
    """The context of the other codec, with the same statistics."""
    monkeypatch.setitem(CODECS, "shuffled", Shuffled)
    places = codec("shuffled", context.skeleton).places
    return dataclasses.replace(context, codec="shuffled", mean=context.mean[places], std=context.std[places])


def rearranged(names: tuple[str, ...], context: Context, shuffled: Context) -> np.ndarray:
    """For each of the columns without the groups `names`, as the other codec orders them, its place in HumanML3D's."""
    plain = np.arange(context.dim)[context.other_columns(*names)].tolist()
    other = shuffled.make_codec().places[shuffled.other_columns(*names)]
    return np.array([plain.index(column) for column in other])


def give(target: torch.nn.Module, source: torch.nn.Module, moved: dict[str, dict[int, np.ndarray]]) -> None:
    """Weights of `source`, those of `moved` rearranged along some dimensions; the codec's statistics stay."""
    values = source.state_dict()
    for name, along in moved.items():
        for dimension, order in along.items():
            values[name] = values[name].index_select(dimension, torch.from_numpy(order))
    own = {name: value for name, value in target.state_dict().items() if ".normalizer." in f".{name}"}
    target.load_state_dict({**values, **own})


def other_batch(batch: Batch, shuffled: Context) -> Batch:
    return Batch(**{**vars(batch), "motion": batch.motion[..., shuffled.make_codec().places]})


def agree(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> None:
    assert a.keys() == b.keys()
    for name in a:
        torch.testing.assert_close(a[name], b[name], rtol=1e-5, atol=1e-5, msg=name)


def of_a_codec(hide: bool, outputs: int, context: Context, shuffled: Context) -> dict[str, dict[int, np.ndarray]]:
    """The weights of a network from features to features that move with the columns; `outputs` is that dimension of
    the decoder's second convolution which holds them."""
    out = rearranged((), context, shuffled)
    return {
        "encoder.first.convolution.weight": {1: rearranged(("contacts",) if hide else (), context, shuffled)},
        "decoder.second.convolution.weight": {outputs: out},
        "decoder.second.convolution.bias": {0: out},
        "decoder.output.weight": {0: out, 1: out},
        "decoder.output.bias": {0: out},
    }


def same_both_ways(plain, other, batch: Batch) -> torch.Tensor:
    """The codes of a batch, after both networks gave the same codes, motions and validation values."""
    theirs, out = other_batch(batch, other.context), rearranged((), plain.context, other.context)
    codes = plain.encode(batch.motion, batch.frames)
    torch.testing.assert_close(other.encode(theirs.motion, batch.frames), codes, rtol=1e-5, atol=1e-5)
    expected = plain.decode(codes, batch.frames // 4)[..., out]
    torch.testing.assert_close(other.decode(codes, batch.frames // 4), expected, rtol=1e-5, atol=1e-5)
    agree(plain.validate(batch), other.validate(theirs))
    return codes


def test_columns_are_a_view_where_they_can_be():
    slices = {"b": slice(2, 4), "a": slice(0, 2), "c": slice(4, 7)}
    assert columns(slices, ["a", "b"]) == slice(0, 4)
    assert columns(slices, ["b", "a"]) == [2, 3, 0, 1]
    assert other_columns(slices, ["c"]) == slice(0, 4)
    assert other_columns(slices, ["b", "none"]) == [0, 1, 4, 5, 6]
    assert other_columns(slices, []) == slice(0, 7)


def test_the_codec_is_known_by_its_name_and_comes_back(shuffled, pipeline):
    from motionary.corpus.store import Corpus

    motion = Corpus.open(pipeline / "data/corpus").motion(0)
    made, plain = shuffled.make_codec(), HumanML3D(shuffled.skeleton)
    features = made.encode(motion)
    np.testing.assert_array_equal(features[:, made.slices["contacts"]], plain.encode(motion)[:, -4:])
    np.testing.assert_array_equal(made.decode(features).positions, plain.decode(plain.encode(motion)).positions)
    assert Context.from_json(shuffled.to_json()).make_codec().slices == made.slices


@pytest.mark.parametrize("hide", [True, False])
def test_tokenizer(context, shuffled, batch, hide):
    settings = TokenizerConfig(
        16,
        8,
        24,
        16,
        decoder_blocks=2,
        codebook_start=0.0,
        hide_contacts=hide,
        position_weight=2.0,
        trajectory_weight=1.0,
    )
    with seeded(0):
        plain, other = Tokenizer(settings, context).eval(), Tokenizer(settings, shuffled).eval()
    give(other, plain, of_a_codec(hide, 0, context, shuffled))
    codes = same_both_ways(plain, other, batch)
    assert len(codes.unique()) > 3
    assert torch.equal(codes, other.encode(other_batch(batch, shuffled).motion, batch.frames))


@pytest.mark.parametrize("hide", [True, False])
def test_autoencoder(context, shuffled, batch, hide):
    settings = AutoencoderConfig(width=32, code_dim=16, hide_contacts=hide, position_weight=2.0, berhu_threshold=0.5)
    with seeded(0):
        plain, other = Autoencoder(settings, context).eval(), Autoencoder(settings, shuffled).eval()
    give(other, plain, of_a_codec(hide, 1, context, shuffled))
    same_both_ways(plain, other, batch)


def test_evaluator(context, shuffled, batch):
    settings = EvaluatorConfig(text_width=8, motion_width=12, dim=12, word_dim=8, snippet_width=24, snippet_dim=16)
    with seeded(0):
        plain, other = Evaluator(settings, context).eval(), Evaluator(settings, shuffled).eval()
    give(other, plain, {"snippets.first.convolution.weight": {1: rearranged(("contacts",), context, shuffled)}})
    theirs = other_batch(batch, shuffled)
    found, expected = (m.embed_motion(b.motion, b.frames) for m, b in ((other, theirs), (plain, batch)))
    torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-5)
    agree(plain.validate(batch), other.validate(theirs))
    foreign = theirs.motion.clone()
    foreign[..., shuffled.columns("contacts")] += 1
    assert torch.equal(other.embed_motion(foreign, batch.frames), found)


def test_local_and_global_motion(context, shuffled, batch):
    root, local = ("root_angular", "root_linear"), rearranged(("root_angular", "root_linear"), context, shuffled)
    with seeded(0):
        plain, other = (Latents(LatentsConfig(width=16, code_dim=12), c).eval() for c in (context, shuffled))
        predictor, its = (GlobalMotion(GlobalMotionConfig(width=8), c).eval() for c in (context, shuffled))
    moved = {"first.convolution.weight": {1: local}, "up_second.weight": {1: local}, "up_second.bias": {0: local}}
    give(other, plain, moved)
    give(its, predictor, {"layers.0.weight": {1: local}})
    theirs = other_batch(batch, shuffled)
    assert torch.equal(plain.root(batch.motion), other.root(theirs.motion))
    torch.testing.assert_close(other.raw(other.root(theirs.motion), other.local(theirs.motion)), theirs.motion)
    torch.testing.assert_close(other.normalizer(theirs.motion)[..., shuffled.columns(*root)], other.root(theirs.motion))
    agree(plain.validate(batch), other.validate(theirs))
    agree(predictor.validate(batch), its.validate(theirs))


def test_style_evaluator_hides_whole_groups(shuffled, batch):
    model = StyleEvaluator(StyleEvaluatorConfig(width=8, dim=4, group_dropout=0.5, noise=0.0), shuffled)
    shown = model._disturb(torch.ones(64, shuffled.dim, 4), torch.Generator().manual_seed(0))[..., 0]
    for name, part in shuffled.slices.items():
        assert (shown[:, part] == shown[:, part][:, :1]).all(), name
        assert 10 < int(shown[:, part.start].sum()) < 54
