"""SMPL poses as AMASS stores them (SMPL, SMPL-H and SMPL-X): joints by forward kinematics on the mean shape.

The rest joints are those of SMPL's mean body, as published with many tools that read SMPL without its licensed model
(smpl2bvh, EDGE); shape parameters are left aside, so that every body has the mean's proportions.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.read.settle import settle, with_roles
from motionary.motion import Motion, Skeleton, name_joints
from motionary.motion.rotations import quat_action, quat_product

SMPL_KEYS = ("poses", "trans", "mocap_framerate", "mocap_frame_rate", "fps")
_BODY = 22  # the first joints of all three models; what follows is hands and face
_WIDTHS = (66, 72, 156, 165)  # SMPL's body alone, SMPL, SMPL-H, SMPL-X
SMPL_ROOT = np.array([-0.0018, -0.2233, 0.0282])  # where the mean body's pelvis is when trans is 0
SMPL_OFFSETS = np.array(
    [
        [0.0, 0.0, 0.0],
        [0.05858135, -0.08228004, -0.01766408],
        [-0.06030973, -0.09051332, -0.01354254],
        [0.00443945, 0.12440352, -0.03838522],
        [0.04345142, -0.38646945, 0.008037],
        [-0.04325663, -0.38368791, -0.00484304],
        [0.00448844, 0.1379564, 0.02682033],
        [-0.01479032, -0.42687458, -0.037428],
        [0.01905555, -0.4200455, -0.03456167],
        [-0.00226458, 0.05603239, 0.00285505],
        [0.04105436, -0.06028581, 0.12204243],
        [-0.03483987, -0.06210566, 0.13032329],
        [-0.0133902, 0.21163553, -0.03346758],
        [0.07170245, 0.11399969, -0.01889817],
        [-0.08295366, 0.11247234, -0.02370739],
        [0.01011321, 0.08893734, 0.05040987],
        [0.12292141, 0.04520509, -0.019046],
        [-0.11322832, 0.04685326, -0.00847207],
        [0.2553319, -0.01564902, -0.02294649],
        [-0.26012748, -0.01436928, -0.03126873],
        [0.26570925, 0.01269811, -0.00737473],
        [-0.26910836, 0.00679372, -0.00602676],
    ]
)
# AMASS is z up; other tools write the same arrays y up.
_USUAL = {"up": {"z": 2.5, "y": 1.0}}


def smpl_motion(
    path: Path, arrays: dict[str, np.ndarray], fps: float | None, options: ReadingOptions
) -> tuple[Motion, Reading]:
    """The body of SMPL poses, with their rotations; y up.

    Args:
        path: names the file in errors.
        arrays: `poses` (T, 66, 72, 156 or 165) axis-angle, `trans` (T, 3) metres, and the rate.
        fps: overrides the file's rate.
        options: what the user knows of the file; it is in metres and not mirrored unless told.

    Raises:
        InputError: arrays of other shapes, no rate, or values that are not finite.
    """
    poses, trans = _checked(path, arrays)
    rate = _rate(path, arrays) if fps is None else fps
    skeleton = Skeleton.named("smpl22").with_offsets(SMPL_OFFSETS)
    rotations = _quaternions(poses[:, : 3 * _BODY].reshape(len(poses), _BODY, 3))
    positions = _place(skeleton, rotations, trans + SMPL_ROOT)
    rest = _place(skeleton, np.tile([0.0, 0, 0, 1], (1, _BODY, 1)), np.zeros((1, 3)))[0]
    options = options.over(ReadingOptions(unit=1.0, mirror=False))
    settled = with_roles(settle(positions, dict(skeleton.roles), rate, options, rest, usual=_USUAL), "names", [])
    positions, rotations = settled.points(positions), settled.rotations(rotations)
    reading = settled.reading
    if options.skip_first and len(positions) > 1:
        positions, rotations = positions[1:], rotations[1:]
        reading = replace(reading, skipped_first=True)
    skeleton = skeleton.with_offsets(settled.offsets(SMPL_OFFSETS))
    try:
        motion = Motion(positions.astype(np.float32), rate, skeleton, rotations.astype(np.float32))
        return (motion if options.mapping is None else name_joints(motion, options.mapping)), reading
    except InputError as error:
        raise InputError(f"{path}, {error.what}", error.value, error.rule) from None


def _checked(path: Path, arrays: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    poses, trans = arrays["poses"], arrays["trans"]
    if poses.ndim == 3 and poses.shape[-1] == 3:
        poses = poses.reshape(len(poses), -1)
    for name, array in (("poses", poses), ("trans", trans)):
        if array.dtype.kind not in "fiu" or array.ndim != 2 or len(array) < 1 or not np.isfinite(array).all():
            raise InputError(f"{path}, {name}", f"{array.dtype} {array.shape}", "must be finite numbers, a row a frame")
    if poses.shape[1] not in _WIDTHS or trans.shape != (len(poses), 3):
        rule = f"poses must be (T, {', '.join(map(str, _WIDTHS))}) angles and trans (T, 3)"
        raise InputError(f"{path}, poses and trans", f"{poses.shape} and {trans.shape}", rule)
    return poses.astype(np.float64), trans.astype(np.float64)


def _rate(path: Path, arrays: dict[str, np.ndarray]) -> float:
    for key in SMPL_KEYS[2:]:
        if key in arrays and arrays[key].size == 1 and arrays[key].dtype.kind in "fiu":
            return float(arrays[key].reshape(()))
    raise InputError(path, "no mocap_framerate", "SMPL poses need a rate: fps=, --fps")


def _quaternions(vectors: np.ndarray) -> np.ndarray:
    """Unit quaternions xyzw of axis-angle vectors (..., 3)."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    share = np.where(angle > 1e-8, np.sin(angle / 2) / np.maximum(angle, 1e-8), 0.5)
    return np.concatenate([vectors * share, np.cos(angle / 2)], axis=-1)


def _place(skeleton: Skeleton, rotations: np.ndarray, root: np.ndarray) -> np.ndarray:
    """(T, J, 3) joints by forward kinematics, without torch."""
    turned, positions = rotations.copy(), np.empty((*rotations.shape[:2], 3))
    positions[:, 0] = root
    for j, p in enumerate(skeleton.parents[1:], 1):
        positions[:, j] = positions[:, p] + quat_action(turned[:, p], SMPL_OFFSETS[j])
        turned[:, j] = quat_product(turned[:, p], rotations[:, j])
    return positions
