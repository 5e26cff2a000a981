"""A case of what training waits for: batches from a corpus on disk, beside the step that they are for."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from motionary.bench.measure import least_time
from motionary.bench.shapes import Shapes
from motionary.bench.workload import Work, clock

_CLIPS, _EPOCHS = 40, 5  # of the demo corpus, which is read as often in a run


def loading(step: Callable[[Shapes], Work]) -> Callable[[Shapes], Work]:
    """Batches of windows from the memory-mapped frames of a corpus; `step` prepares the training step of the same."""

    def prepare(shapes: Shapes) -> Work:
        """A corpus, and a note of how long a batch takes beside a step."""
        from motionary.corpus.batches import Batches
        from motionary.corpus.datasets import Windows
        from motionary.corpus.preprocess import preprocess
        from motionary.corpus.store import Corpus

        folder = tempfile.TemporaryDirectory()
        preprocess({"clips": _CLIPS, "workers": 1}, Path(folder.name) / "corpus", progress=False)
        corpus = Corpus.open(Path(folder.name) / "corpus")
        batches = Batches(Windows(corpus, window=shapes.window), shapes.windows)
        count = _EPOCHS * len(batches)

        def note(seconds: float) -> str:
            """What a batch costs, alone and of a step."""
            taken = least_time(step(shapes).run, repeats=1)[0]
            share = 100 * seconds / count / taken
            return f"{clock(seconds / count)} a batch, {share:.1g}% of the tokenizer step, {clock(taken)}"

        return Work(lambda: (folder.name, [sum(1 for _ in batches.epoch(e)) for e in range(_EPOCHS)]), note)

    return prepare
