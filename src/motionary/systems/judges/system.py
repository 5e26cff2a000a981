"""How the judges and the retrieval baseline are built on what they need, and opened for use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motionary.corpus.context import Context
from motionary.errors import configure
from motionary.systems.io import CATALOGUE, Trained
from motionary.whole import check_output

if TYPE_CHECKING:
    from motionary.systems.judges.action_evaluator import ActionEvaluator, ActionJudge
    from motionary.systems.judges.corpus_search import Retrieval
    from motionary.systems.judges.evaluator import Evaluator
    from motionary.systems.judges.joint_evaluator import JointEvaluator
    from motionary.systems.judges.judge import Judge
    from motionary.systems.judges.style_evaluator import StyleEvaluator, StyleJudge


def build_evaluator(settings: Mapping[str, Any], context: Context, trained: Trained) -> Evaluator:
    """A fresh evaluator on the codes of the trained autoencoder; `settings` are the remaining keys of its config."""
    from motionary.systems.judges.evaluator import Evaluator, EvaluatorConfig

    autoencoder = trained.load("autoencoder")
    config = configure(EvaluatorConfig, {**settings, **autoencoder.config.as_upstream()}, "evaluator")
    return Evaluator(config, context).take_snippets(autoencoder.encoder)


def build_joint_evaluator(settings: Mapping[str, Any], context: Context, trained: Trained) -> JointEvaluator:
    """A fresh judge of joints; `settings` are the keys of its config."""
    from motionary.systems.judges.joint_evaluator import JointEvaluator, JointEvaluatorConfig

    return JointEvaluator(configure(JointEvaluatorConfig, settings, "joint_evaluator"), context)


def open_judge(trained: Trained, name: str) -> Judge:
    """A trained evaluator, for motions and sentences of any number."""
    from motionary.systems.judges.judge import Judge

    return Judge(trained.path(name), str(trained.device))


def build_style_evaluator(settings: Mapping[str, Any], context: Context, trained: Trained) -> StyleEvaluator:
    """Fresh classifiers of style and content; `settings` are the keys of their config."""
    from motionary.systems.judges.style_evaluator import StyleEvaluator, StyleEvaluatorConfig

    return StyleEvaluator(configure(StyleEvaluatorConfig, settings, "style_evaluator"), context)


def open_style_judge(trained: Trained, name: str) -> StyleJudge:
    """The trained classifiers, for motions of any number."""
    from motionary.systems.judges.style_evaluator import StyleJudge

    return StyleJudge.open(trained.path(name), str(trained.device))


def build_action_evaluator(settings: Mapping[str, Any], context: Context, trained: Trained) -> ActionEvaluator:
    """A fresh classifier of actions; `settings` are the keys of its config."""
    from motionary.systems.judges.action_evaluator import ActionEvaluator, ActionEvaluatorConfig

    return ActionEvaluator(configure(ActionEvaluatorConfig, settings, "action_evaluator"), context)


def open_action_judge(trained: Trained, name: str) -> ActionJudge:
    """The trained classifier, for motions of any number."""
    from motionary.systems.judges.action_evaluator import ActionJudge

    return ActionJudge.open(trained.path(name), str(trained.device))


def open_retrieval(trained: Trained, name: str) -> Retrieval:
    """Answers copied from the corpus beside the folder of models, or from the texts that a bundle brings of it."""
    from motionary.corpus.store import Corpus
    from motionary.systems.judges.corpus_search import Index, Retrieval

    own, run = trained.folder / CATALOGUE, trained.folder.parent
    corpus = Corpus.open(own, motions=False) if own.is_dir() else Corpus.open(check_output(run, "data/corpus"))
    index = Index.load(check_output(run, f"{trained.folder.name}/{trained.path(name).name}"))
    return Retrieval(corpus, open_judge(trained, index.judge), index)
