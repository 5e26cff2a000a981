"""Body models of SMPL, SMPL-H and SMPL-X, which are licensed and only their owners have: where a body's joints are.

A body of some shape has its joints at J_regressor (v_template + shapedirs betas) (Loper et al. 2015, "SMPL", section
3.1), so that of a model only this product is kept: the joints of the mean and how each shape parameter moves them.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.files import readable
from motionary.formats.read.numpy_files import ArrayArchive
from motionary.motion import Skeleton

BODY = 22  # the first joints of all three models; what follows is hands and face
_KEYS = ("v_template", "J_regressor", "shapedirs", "kintree_table")
_CONVERT = (
    "pickles are never loaded, since they can run anything; where you trust it, convert it once: "
    "python -c \"import pickle, numpy as np; d = pickle.load(open('model.pkl', 'rb'), encoding='latin1'); "
    "d['J_regressor'] = np.asarray(getattr(d['J_regressor'], 'todense', lambda: d['J_regressor'])()); "
    f"np.savez('model.npz', **{{k: np.array(d[k]) for k in {_KEYS}}})\""
)


@dataclass(frozen=True)
class BodyModel:
    """What a model says of the body's 22 joints.

    Attributes:
        mean: (22, 3) metres, of the mean shape.
        shapes: (22, 3, B) metres for each unit of the B shape parameters.
    """

    mean: np.ndarray
    shapes: np.ndarray

    def joints(self, betas: np.ndarray) -> np.ndarray:
        """(22, 3) metres, at rest; `betas` (n,) beyond the model's B, and those that are absent, count as zero."""
        count = min(len(betas), self.shapes.shape[-1])
        return self.mean + self.shapes[..., :count] @ betas[:count]


def read_body(path: str | os.PathLike) -> BodyModel:
    """The body model of an .npz file with v_template, J_regressor, shapedirs and kintree_table; it is kept in memory.

    Raises:
        InputError: a pickle, an absent or damaged file, or arrays of other shapes.
    """
    path = readable(path)
    if path.suffix.lower() != ".npz":
        rule = _CONVERT if path.suffix.lower() in (".pkl", ".pickle") else "must be an .npz file"
        raise InputError(path, path.suffix or "no extension", rule)
    state = path.stat()
    return _read(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=4)
def _read(path: Path, changed: int, size: int) -> BodyModel:
    with ArrayArchive(path) as archive:
        if missing := [key for key in _KEYS if key not in archive.names]:
            raise InputError(path, f"without {', '.join(missing)}", f"a body model must hold {', '.join(_KEYS)}")
        template, regressor, shapes, tree = (archive.read(key).astype(np.float64) for key in _KEYS)
    vertices = len(template)
    wanted = {
        "v_template": (template, (vertices, 3)),
        "J_regressor": (regressor, (max(len(regressor), BODY), vertices)),
        "shapedirs": (shapes, (vertices, 3, *shapes.shape[2:3])),
        "kintree_table": (tree, (2, len(regressor))),
    }
    for key, (array, shape) in wanted.items():
        if array.shape != shape or array.size == 0 or not np.isfinite(array).all():
            rule = f"must be finite numbers of shape {shape}, of at least {BODY} joints"
            raise InputError(f"{path}, {key}", f"{array.shape}", rule)
    if shapes.ndim != 3 or tuple(tree[0, 1:BODY]) != Skeleton.named("smpl22").parents[1:]:
        raise InputError(f"{path}, kintree_table", tree[0, :BODY].tolist(), f"must begin with SMPL's {BODY} joints")
    regressor = regressor[:BODY]
    return BodyModel(regressor @ template, np.einsum("jv,vcb->jcb", regressor, shapes))
