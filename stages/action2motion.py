"""Trains motions of action labels (thesis chapter 3): one model for each pose decoder that is asked for."""

from _project import ROOT  # isort: skip
import json
from typing import Any

import hydra

from motionary.corpus.acted import Acted, ActionLabels, lengths_told
from motionary.corpus.store import Corpus
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train_each
from motionary.systems.action2motion.variants import variants_of
from motionary.systems.io import save_model


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/action2motion, reports/action2motion.json"""
    with Stage("action2motion", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        labels, section, settings = ActionLabels.of(corpus), stage.section, stage.training()
        models: dict[str, Any] = {}
        report: dict[str, Any] = {"actions": list(labels.coarse), "fine_actions": list(labels.fine)}
        for name, own in variants_of(section["variants"], section["fine_variants"]).items():
            if known := labels.fine if own["fine"] else labels.coarse:
                models[name] = build(stage, corpus.context, labels=known, **own)
        if models:
            data = Acted(corpus, labels, labels.rows(corpus, "train"), **stage.data)
            held = Acted(corpus, labels, labels.held(corpus), stage.data["window"], random=False)
            report["short_windows"] = lengths_told(data, "action2motion")
            histories = train_each(stage, models, data, held, settings)
            report |= {name: last_losses(history) for name, history in histories.items()}
        else:
            stage.figure_path("none").parent.mkdir(exist_ok=True)  # DVC expects the folder
            report["note"] = "the corpus names no action: nothing is trained, and no motion can be asked for by one"
            print(f"action2motion: {report['note']}")
        with stage.publish("models/action2motion") as folder:
            (folder / "actions.json").write_text(json.dumps({"variants": list(models)}) + "\n")
            for name, model in models.items():
                save_model(folder / name, "action2motion", model, corpus.context)
        stage.report(report)


if __name__ == "__main__":
    main()
