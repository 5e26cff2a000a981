"""Scores stylization in every way it can be used, beside a floor and a ceiling (thesis 5.3), and draws its styles."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.cells import style_split
from motionary.corpus.store import Corpus
from motionary.errors import configure
from motionary.evaluation.style_figures import draw_codes, many_styles
from motionary.evaluation.style_scores import StyleProtocol, score_stylization
from motionary.formats.render.video import render_strip
from motionary.pipeline.stage import Stage, run_stage
from motionary.systems.io import choose_device, open_system
from motionary.systems.protocols import StyleClassifier
from motionary.systems.registry import JUDGE_STYLE, STYLIZE
from motionary.systems.stylization.style_transfer import StyleTransfer


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """models/stylization, models/global_motion, models/style_evaluator -> reports/style_evaluation.json, figures"""
    with Stage("style_evaluation", config, ROOT, sections=("styles",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        split = style_split(corpus, **stage.values["styles"], seed=stage.seed)
        models, device = stage.serving("stylization", "style_evaluator"), choose_device(config.device)
        stylizer: StyleTransfer = open_system("stylization", STYLIZE, models, device)
        judge: StyleClassifier = open_system("style_evaluator", JUDGE_STYLE, models, device)
        protocol = configure(StyleProtocol, stage.section, "style_evaluation")
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
        about = {"judge": judge.hash, "corpus": corpus.hash, "styles": labels, "repetitions": protocol.repetitions}
        stage.report({**about, "style_transfer": found})


if __name__ == "__main__":
    main()
