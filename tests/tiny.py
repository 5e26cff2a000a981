"""A whole pipeline in small, made in seconds: a demo corpus and untrained systems on it."""

from __future__ import annotations

from pathlib import Path

import pytest


def build_pipeline(root: Path, clips: int = 24) -> Path:
    """Writes root/data/corpus and root/models as `dvc repro` would, with random weights; returns root."""
    import torch

    from motionary.corpus.preprocess import preprocess
    from motionary.corpus.store import Corpus
    from motionary.models.autoencoder import Autoencoder, AutoencoderConfig
    from motionary.models.evaluator import Evaluator, EvaluatorConfig
    from motionary.models.inverse_alignment import build
    from motionary.models.io import save_model
    from motionary.models.judge import Judge
    from motionary.models.motion2text import Motion2Text, Motion2TextConfig
    from motionary.models.retrieval import Index
    from motionary.models.text2length import Text2Length, Text2LengthConfig
    from motionary.models.text2motion import Text2Motion, Text2MotionConfig
    from motionary.models.text2token import Text2Token, Text2TokenConfig
    from motionary.models.tokenizer import Tokenizer, TokenizerConfig

    torch.set_num_threads(1)
    ratios = [0.5, 0.2, 0.3]
    preprocess({"clips": clips, "workers": 1, "mirror": False, "ratios": ratios}, root / "data/corpus", progress=False)
    corpus, models = Corpus.open(root / "data/corpus"), root / "models"
    context = corpus.context
    with torch.random.fork_rng():
        torch.manual_seed(0)
        snippets = Autoencoder(AutoencoderConfig(width=16, code_dim=12), context)
        judge = EvaluatorConfig(text_width=8, motion_width=12, dim=12, word_dim=8, **Evaluator.upstream(snippets))
        systems = {
            "tokenizer": Tokenizer(TokenizerConfig(codes=16, code_dim=8, width=16, fine_width=8), context),
            "evaluator": Evaluator(judge, context).take_snippets(snippets),
            "text2token": Text2Token(Text2TokenConfig(16, word_dim=8, text_width=8, width=16, most_tokens=12), context),
            "motion2text": Motion2Text(
                Motion2TextConfig(16, width=16, layers=1, feed_forward=32, heads=2, most_words=6), context
            ),
            "text2length": Text2Length(Text2LengthConfig(word_dim=8, text_width=8), context),
            "text2motion": Text2Motion(
                Text2MotionConfig(8, 8, 16, attention_width=8, latent=4, **Text2Motion.upstream(snippets)), context
            ).take_snippets(snippets),
        }
        for name, model in systems.items():
            save_model(models / name, name, model, context)
        save_model(models / "inverse_alignment", "inverse_alignment", build({}, context, models), context)
    judge = Judge(models)
    Index(judge.motions([corpus.features(i) for i in range(len(corpus))]), judge.hash).save(models / "retrieval")
    return root


def add_stylizers(root: Path, models: Path) -> None:
    """Untrained stylizers of both settings, on the styles of root/data/corpus, into `models`."""
    from motionary.corpus.store import Corpus
    from motionary.models.global_motion import GlobalMotion, GlobalMotionConfig
    from motionary.models.io import save_model
    from motionary.models.latents import Latents, LatentsConfig
    from motionary.models.layers import seeded
    from motionary.models.stylization import SETTINGS, build

    context = Corpus.open(root / "data/corpus").context
    with seeded(0):
        latents = Latents(LatentsConfig(width=16, code_dim=12), context)
        save_model(
            models / "global_motion", "global_motion", GlobalMotion(GlobalMotionConfig(width=8), context), context
        )
        for setting in SETTINGS:
            values = {"width": 16, "content_dim": 8, "style_dim": 6, "blocks": 1}
            save_model(
                models / "stylization" / setting, "stylization", build(values, setting, latents, context, 64), context
            )


@pytest.fixture(scope="session")
def pipeline(tmp_path_factory) -> Path:
    """A folder with data/corpus and models/ of untrained systems; read only."""
    return build_pipeline(tmp_path_factory.mktemp("pipeline"))
