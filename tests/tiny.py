"""A whole pipeline in small, made in seconds: a demo corpus and untrained systems on it."""

from __future__ import annotations

from pathlib import Path

import pytest


def build_pipeline(root: Path, clips: int = 24) -> Path:
    """Writes root/data/corpus and root/models as `dvc repro` would, with random weights; returns root."""
    import torch

    from motionary.corpus.preprocess import preprocess
    from motionary.corpus.store import Corpus
    from motionary.systems.io import Trained, build_model, save_model
    from motionary.systems.judges.corpus_search import Index, meanings_of
    from motionary.systems.judges.evaluator import Evaluator, EvaluatorConfig
    from motionary.systems.judges.joint_evaluator import JointEvaluator, JointEvaluatorConfig
    from motionary.systems.judges.judge import Judge
    from motionary.systems.t2m.autoencoder import Autoencoder, AutoencoderConfig
    from motionary.systems.t2m.text2length import Text2Length, Text2LengthConfig
    from motionary.systems.t2m.text2motion import Text2Motion, Text2MotionConfig
    from motionary.systems.tm2t.motion2text import Motion2Text, Motion2TextConfig
    from motionary.systems.tm2t.text2token import Text2Token, Text2TokenConfig
    from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

    torch.set_num_threads(1)
    ratios = [0.5, 0.2, 0.3]
    preprocess({"clips": clips, "workers": 1, "mirror": False, "ratios": ratios}, root / "data/corpus", progress=False)
    corpus, models = Corpus.open(root / "data/corpus"), root / "models"
    context = corpus.context
    with torch.random.fork_rng():
        torch.manual_seed(0)
        snippets = Autoencoder(AutoencoderConfig(width=16, code_dim=12), context)
        judge = EvaluatorConfig(text_width=8, motion_width=12, dim=12, word_dim=8, **snippets.config.as_upstream())
        systems = {
            "tokenizer": Tokenizer(TokenizerConfig(codebook_size=16, code_dim=8, width=16, fine_width=8), context),
            "evaluator": Evaluator(judge, context).take_snippets(snippets.encoder),
            "joint_evaluator": JointEvaluator(
                JointEvaluatorConfig(width=16, num_layers=1, num_heads=2, dim=12), context
            ),
            "text2token": Text2Token(Text2TokenConfig(16, word_dim=8, text_width=8, width=16, max_tokens=12), context),
            "motion2text": Motion2Text(
                Motion2TextConfig(16, width=16, num_layers=1, dim_feedforward=32, num_heads=2, max_words=6), context
            ),
            "text2length": Text2Length(Text2LengthConfig(word_dim=8, text_width=8), context),
            "text2motion": Text2Motion(
                Text2MotionConfig(8, 8, 16, attention_width=8, latent=4, **snippets.config.as_upstream()), context
            ).take_snippets(snippets.encoder, snippets.decoder),
        }
        for name, model in systems.items():
            save_model(models / name, name, model, context)
        aligned = build_model("inverse_alignment", {}, context, Trained(models))
        save_model(models / "inverse_alignment", "inverse_alignment", aligned, context)
    judge = Judge(models / "evaluator")
    Index(judge.motions([corpus.features(i) for i in range(len(corpus))]), judge.hash).save(models / "retrieval")
    meanings_of(corpus).save(models / "retrieval")
    return root


def add_stylizers(root: Path, models: Path) -> None:
    """Untrained stylizers of both settings, on the styles of root/data/corpus, into `models`."""
    from motionary.corpus.store import Corpus
    from motionary.nn.layers import seeded
    from motionary.systems.io import Trained, build_model, save_model
    from motionary.systems.stylization.global_motion import GlobalMotion, GlobalMotionConfig
    from motionary.systems.stylization.latents import Latents, LatentsConfig
    from motionary.systems.stylization.stylizer import SETTINGS

    context = Corpus.open(root / "data/corpus").context
    with seeded(0):
        latents = Latents(LatentsConfig(width=16, code_dim=12), context)
        save_model(
            models / "global_motion", "global_motion", GlobalMotion(GlobalMotionConfig(width=8), context), context
        )
        save_model(models / "latents", "latents", latents, context)
        for setting in SETTINGS:
            values = {"width": 16, "content_dim": 8, "style_dim": 6, "num_blocks": 1, "setting": setting, "window": 64}
            model = build_model("stylization", values, context, Trained(models))
            save_model(models / "stylization" / setting, "stylization", model, context)


def add_temos(root: Path, models: Path) -> None:
    """Untrained TEMOS on root/data/corpus, with its index, into `models`."""
    from motionary.corpus.store import Corpus
    from motionary.nn.layers import seeded
    from motionary.systems.io import Trained, build_model, save_model
    from motionary.systems.temos.joint_space import JointSpace, LatentIndex
    from motionary.systems.temos.training_data import training_data

    corpus = Corpus.open(root / "data/corpus")
    settings = {"latent": 16, "num_layers": 1, "num_heads": 2, "dim_feedforward": 16, "most_captions": 1}
    with seeded(0):
        model = build_model("temos", settings, corpus.context, Trained(models)).eval()
    data = training_data(model, corpus, root / "made/motion", root / "made/texts")
    save_model(models / "temos", "temos", model, corpus.context)
    LatentIndex(JointSpace(model, "").own(data.features)).save(models / "temos")


@pytest.fixture(scope="session")
def pipeline(tmp_path_factory) -> Path:
    """A folder with data/corpus and models/ of untrained systems; read only."""
    return build_pipeline(tmp_path_factory.mktemp("pipeline"))
