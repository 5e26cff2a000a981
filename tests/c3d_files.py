"""C3D files for tests, written by the library that reads them."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence

import c3d
import numpy as np


def c3d_bytes(labels: Sequence[str], places: np.ndarray, rate: float, unit: str = "mm") -> bytes:
    """A file of labelled points (T, N, 3); what is NaN was not seen."""
    writer = c3d.Writer(point_rate=rate, point_units=f"{unit:4}")
    writer.set_point_labels(list(labels))
    unseen = ~np.isfinite(places).all(-1)
    frames = np.zeros((*places.shape[:2], 5), np.float32)
    frames[..., :3] = np.where(unseen[..., None], 0, places)
    frames[..., 3:] = np.where(unseen, -1, 0)[..., None]
    for frame in frames:
        writer.add_frames([(frame, np.array([[]]))])
    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there are no analog channels
        writer.write(file)
    return file.getvalue()
