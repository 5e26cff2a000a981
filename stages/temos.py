"""Trains TEMOS: text and motion in one latent (TEMOS 3.3)."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.store import Corpus
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.pipeline.workspace import values_hash
from motionary.systems.io import model_hash, save_model
from motionary.systems.temos.joint_space import JointSpace, LatentIndex
from motionary.systems.temos.training_data import training_data


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/temos, reports/temos.json"""
    with Stage("temos", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model, settings = build(stage, corpus.context), stage.training()
        own = model.config
        motion = values_hash([corpus.hash, own.features, own.fps])
        texts = values_hash([corpus.hash, own.language_model, own.fine_tune, own.most_captions])
        made = stage.cache.parent  # outlives this run: another of other sizes reads the same
        data = training_data(model, corpus, made / f"motion-{motion[:16]}", made / f"texts-{texts[:16]}")

        history = train(stage, model, data.train, data.validation, settings, length_sorted=True)
        with stage.publish("models/temos") as folder:
            save_model(folder, "temos", model, corpus.context)
            if model.motion is not None:
                LatentIndex(JointSpace(model, model_hash(folder)).own(data.features)).save(folder)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
