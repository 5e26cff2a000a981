"""What was said of a corpus's training windows, without the motions: what the search of a bundle looks over."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from motionary.corpus.store import Corpus


def catalogued(corpus: Corpus) -> np.ndarray:
    """Rows of the captioned training windows, without the mirrored copies that preprocess added."""
    rows = corpus.rows("train", captioned=True)
    return rows[~corpus.added[rows]]


def write_catalogue(corpus: Corpus, rows: np.ndarray, folder: Path) -> None:
    """Writes the tables of these rows (ascending) as a corpus without frames, for ``Corpus.open(motions=False)``."""
    folder.mkdir(parents=True)
    corpus.context.save(folder / "context.json")
    clips = pq.read_table(corpus.folder / "clips.parquet").take(rows)
    for name in ("offset", "length"):  # of frames that do not come along
        place = clips.schema.get_field_index(name)
        clips = clips.set_column(place, clips.field(place), pa.array(np.zeros(len(rows), np.int64)))
    captions = pq.read_table(corpus.folder / "captions.parquet")
    kept = np.flatnonzero(np.isin(corpus.captions.clip, rows))
    captions = captions.take(kept)
    place = captions.schema.get_field_index("clip")
    own = np.searchsorted(rows, corpus.captions.clip[kept]).astype(np.int64)
    captions = captions.set_column(place, captions.field(place), pa.array(own))
    for table, name in ((clips, "clips"), (captions, "captions")):
        pq.write_table(table, folder / f"{name}.parquet", compression="zstd", write_page_checksum=True)
