"""The picture of the pipeline in the README: ``python -m motionary.pipeline.dag docs/dag.png``."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from motionary.errors import InputError, exit_code

_WIDTH, _HEIGHT, _ACROSS, _DOWN = 1.9, 0.62, 2.35, 0.8  # inches: of a box, and from one to the next
_SWEEPS = 8  # over the layers, each put in order by its neighbours
_LONGEST = 62  # characters of what is said of a stage
_HIDDEN = {"code"}  # on which every stage hangs


def stage_graph(root: Path) -> Any:
    """What ``dvc dag`` draws: a directed networkx graph from each stage to those that read what it writes.

    The stages of one ``foreach`` are one node; edges that follow from others are left out, and so is the stage `code`.

    Raises:
        InputError: `root` is no folder with a dvc.yaml.
    """
    import networkx
    from dvc.repo import Repo

    if not (root / "dvc.yaml").is_file():
        raise InputError(root, "no dvc.yaml", "run this in the project's root")
    graph = networkx.DiGraph()
    with Repo(str(root)) as repo:
        graph.add_nodes_from(_name(stage) for stage in repo.index.graph)
        graph.add_edges_from((_name(writer), _name(reader)) for reader, writer in repo.index.graph.edges)
    graph.remove_nodes_from(_HIDDEN)
    return networkx.transitive_reduction(graph)


def _name(stage: Any) -> str:
    return stage.addressing.split("@")[0].split(":")[-1]


def layers(graph: Any) -> list[list[str]]:
    """The nodes by the longest way that leads to them; within a layer, near those that they are joined to."""
    import networkx

    found = [sorted(names) for names in networkx.topological_generations(graph)]
    height = {name: row - len(layer) / 2 for layer in found for row, name in enumerate(layer)}
    for _ in range(_SWEEPS):
        for layer in (*found, *reversed(found)):
            near = {n: [height[other] for other in (*graph.predecessors(n), *graph.successors(n))] for n in layer}
            layer.sort(key=lambda name: sum(near[name]) / max(1, len(near[name])))
            height |= {name: row - len(layer) / 2 for row, name in enumerate(layer)}
    return found


def draw(graph: Any, about: dict[str, str]) -> Any:
    """A matplotlib figure: a box for each stage with what it is for, from left to right.

    Args:
        graph: see `stage_graph`.
        about: a few words of each stage.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

    columns = layers(graph)
    rows = max(map(len, columns))
    figure = Figure(figsize=(_ACROSS * len(columns), _DOWN * rows))
    axis = figure.add_axes((0, 0, 1, 1), xlim=(0, _ACROSS * len(columns)), ylim=(0, _DOWN * rows))
    axis.axis("off")
    at = {}
    for column, names in enumerate(columns):
        for row, name in enumerate(names):
            at[name] = _ACROSS * (column + 0.5), _DOWN * (rows / 2 + len(names) / 2 - row - 0.5)
    for name, (x, y) in at.items():
        corner = x - _WIDTH / 2, y - _HEIGHT / 2
        box = FancyBboxPatch(corner, _WIDTH, _HEIGHT, boxstyle="round,pad=0,rounding_size=0.06")
        box.set(facecolor="#f2f6fb", edgecolor="#3b6ea5", linewidth=0.8)
        axis.add_patch(box)
        axis.text(x, y + 0.17, name, ha="center", va="center", fontsize=9, fontweight="bold")
        words = textwrap.fill(_brief(about.get(name, "")), 34)
        axis.text(x, y - 0.1, words, ha="center", va="center", fontsize=6.5, color="#444444")
    for before, after in graph.edges:
        (x0, y0), (x1, y1) = at[before], at[after]
        ends = (x0 + _WIDTH / 2, y0), (x1 - _WIDTH / 2, y1)
        arrow = FancyArrowPatch(*ends, arrowstyle="-|>", mutation_scale=7, shrinkA=0, shrinkB=0, zorder=0)
        arrow.set(color="#8aa4c0", linewidth=0.8)
        axis.add_patch(arrow)
    return figure


def _brief(text: str) -> str:
    """The first parts of a sentence, and no chapters."""
    text = text.split(" (thesis")[0]
    while len(text) > _LONGEST and "," in text:
        text = text.rsplit(",", 1)[0]
    return text


def write(root: Path, path: Path) -> None:
    """Draws the pipeline of the project in `root` into a picture."""
    graph = stage_graph(root)
    stages = yaml.safe_load((root / "dvc.yaml").read_text())["stages"]
    draw(graph, {name: stage.get("do", stage).get("desc", "") for name, stage in stages.items()}).savefig(path, dpi=100)


def main(arguments: Sequence[str]) -> int:
    """Writes the picture to the path given; exit code 2 where there is no pipeline."""
    if len(arguments) != 1:
        print("usage: python -m motionary.pipeline.dag PICTURE", file=sys.stderr)
        return 2
    return exit_code(lambda: write(Path.cwd(), Path(arguments[0])))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
