"""Scores stylization in every way it can be used, beside a floor and a ceiling (thesis 5.3), and draws its styles."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.store import Corpus
from motionary.corpus.styles import style_split
from motionary.evaluation.style_figures import draw_codes, many_styles
from motionary.evaluation.stylization import StyleProtocol, score_stylization
from motionary.formats.video import render_strip
from motionary.models.io import choose_device
from motionary.models.style_evaluator import StyleJudge
from motionary.models.stylization import open_stylizer
from motionary.training.settings import build
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """models/stylization, models/global_motion, models/style_evaluator -> reports/style_evaluation.json, figures"""
    with Stage("style_evaluation", config, ROOT, sections=("styles",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        split = style_split(corpus, **stage.values["styles"], seed=stage.seed)
        models = [stage.input(f"models/{name}") for name in ("stylization", "global_motion", "style_evaluator")]
        device = choose_device(config.device)
        stylizer, judge = open_stylizer(models[0].parent, device), StyleJudge(models[0].parent, device)
        protocol = build(StyleProtocol, stage.section, "style_evaluation")
        settings = list(stylizer.stylizers)

        found = score_stylization(stylizer, judge, corpus, split, protocol, settings, stage.seed)
        figure = draw_codes(stylizer, corpus, split, settings, protocol.codes, stage.seed)
        if figure is not None:
            stage.figure("style_codes", figure)
        strip = stage.figure_path("one_motion_many_styles.png")
        motions, captions = many_styles(stylizer, corpus, split, settings, stage.seed)
        render_strip(motions, strip, captions, width=105, height=150)
        stage.tracker.artifact(strip, "figures")
        labels = [split.styles[i] for i in split.scored]
        about = {"evaluator": judge.hash, "corpus": corpus.hash, "styles": labels, "repetitions": protocol.repetitions}
        stage.report({**about, "stylization": found})


if __name__ == "__main__":
    main()
