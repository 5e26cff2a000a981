"""Takes stock of one data root: its files with hashes and durations, and what is wrong with them."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.sources import inventory
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.workspace import values_hash


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data root -> data/sources/root_<root>/inventory.json"""
    root = config.source.root
    with Stage("source", config, ROOT, label=root) as stage:
        # DVC removes a stage's outs before it runs: what is known of unchanged files is kept beside the project.
        stock = stage.workspace.home / ".cache" / "source" / f"{values_hash(str((ROOT / root).resolve()))}.json"
        stage.report(inventory(ROOT / root, stock=stock), f"data/sources/root_{root}/inventory.json")


if __name__ == "__main__":
    main()
