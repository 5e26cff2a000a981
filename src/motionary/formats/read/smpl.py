"""SMPL poses as AMASS stores them (SMPL, SMPL-H and SMPL-X): joints by forward kinematics.

Where the user has the licensed body model, the rest joints are those of the file's own shape. Without it they are those
of SMPL's mean body, as published with many tools that read SMPL without its model (smpl2bvh, EDGE); shape parameters
are then left aside, so that every body has the mean's proportions.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.formats.animated_rig import place
from motionary.formats.read.body_model import BODY, read_body
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.read.settle import settle, with_roles
from motionary.motion import Motion, Skeleton, name_joints
from motionary.motion.rotations import rotvec_to_unitquat

_RATES = ("mocap_framerate", "mocap_frame_rate", "fps", "framerate", "frame_rate")
# What programs call the same arrays: AMASS, AIST++, and those who name the parameters as the smplx package does.
_POSES, _TRANS = ("poses", "smpl_poses"), ("trans", "smpl_trans", "transl")
_ROOT, _BODY = ("root_orient", "global_orient"), ("pose_body", "body_pose")
_WIDTHS = (66, 72, 156, 165)  # SMPL's body alone, SMPL, SMPL-H, SMPL-X
_FASTEST, _HIGHEST = 20.0, 20.0  # m/s at which nobody moves, m at which nobody stays: trans is in another unit
_LARGEST = 3 * np.pi  # rad; angles of joints beyond it are in degrees
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
_SAME_SHAPE = 1e-3  # by which betas of one body may differ
# AMASS is z up; other tools write the same arrays y up.
_USUAL = {"up": {"z": 2.5, "y": 1.0}}


def smpl_arrays(names: Collection[str]) -> tuple[str, ...]:
    """Those of a file's arrays that SMPL poses are read from, nothing where they are not all there."""
    poses, trans, root, body = (
        next((name for name in known if name in names), "") for known in (_POSES, _TRANS, _ROOT, _BODY)
    )
    if not trans or not (poses or (root and body)):
        return ()
    return (*([poses] if poses else [root, body]), trans, *(rate for rate in _RATES if rate in names))


def smpl_motion(
    path: Path, arrays: dict[str, np.ndarray], fps: float | None, options: ReadingOptions
) -> tuple[Motion, Reading]:
    """The body of SMPL poses, with their rotations; y up.

    Args:
        path: names the file in errors.
        arrays: `poses` (T, 66, 72, 156 or 165) axis-angle, or its root and its body apart, `trans` (T, 3) metres, and
            the rate; by the names that `smpl_arrays` gives.
        fps: overrides the file's rate.
        options: what the user knows of the file; it is in metres and not mirrored unless told. With its `body` the
            joints are those of the file's `betas` (n,), or (T, n) that do not change.

    Raises:
        InputError: arrays of other shapes, no rate, or values that are not finite.
    """
    poses, trans, padding = _without_padding(*_checked(path, arrays))
    rate = _rate(path, arrays) if fps is None else fps
    offsets, pelvis, notes = _rest(path, arrays, options)
    notes = [*padding, *notes]
    skeleton = Skeleton.named("smpl22").with_offsets(offsets)
    rotations = rotvec_to_unitquat(poses[:, : 3 * BODY].reshape(len(poses), BODY, 3))
    positions, _ = place(skeleton.parents, rotations, _moved(offsets, trans + pelvis))
    rest = place(skeleton.parents, np.tile([0.0, 0, 0, 1], (1, BODY, 1)), offsets[None])[0][0]
    options = options.over(ReadingOptions(unit=1.0, mirror=False))
    settled = with_roles(settle(positions, dict(skeleton.roles), rate, options, rest, usual=_USUAL), "names", notes)
    positions, rotations = settled.points(positions), settled.rotations(rotations)
    if options.unit == 1.0:
        _check_metres(path, positions[:, 0], rate)
    reading = settled.reading
    if options.body is not None:
        reading = replace(reading, told=(*reading.told, "body"))
    if options.skip_first and len(positions) > 1:
        positions, rotations = positions[1:], rotations[1:]
        reading = replace(reading, skipped_first=True)
    skeleton = skeleton.with_offsets(settled.offsets(offsets))
    try:
        motion = Motion(positions.astype(np.float32), rate, skeleton, rotations.astype(np.float32))
        return (motion if options.mapping is None else name_joints(motion, options.mapping)), reading
    except InputError as error:
        raise InputError(f"{path}, {error.what}", error.value, error.rule) from None


def _checked(path: Path, arrays: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """`poses` (T, a width of `_WIDTHS`) and `trans` (T, 3), float64."""
    rows = {}
    for name in smpl_arrays(arrays):
        if name in _RATES:
            continue
        array = arrays[name]
        if array.ndim >= 3 and array.shape[0] == 1:
            array = array[0]  # a batch of one
        if array.ndim == 3 and array.shape[-1] == 3:
            array = array.reshape(len(array), -1)
        if array.dtype.kind not in "fiu" or array.ndim != 2 or len(array) < 1 or not np.isfinite(array).all():
            raise InputError(f"{path}, {name}", f"{array.dtype} {array.shape}", "must be finite numbers, a row a frame")
        rows[name] = array.astype(np.float64)
    *parts, place = rows
    if len({len(array) for array in rows.values()}) > 1:
        shapes = " and ".join(str(array.shape) for array in rows.values())
        raise InputError(f"{path}, {' and '.join(rows)}", shapes, "must have as many rows")
    poses, trans = np.concatenate([rows[name] for name in parts], axis=1), rows[place]
    if poses.shape[1] not in _WIDTHS or trans.shape[1] != 3:
        rule = f"poses must be (T, {', '.join(map(str, _WIDTHS))}) angles and trans (T, 3)"
        raise InputError(f"{path}, {' and '.join(rows)}", f"{poses.shape} and {trans.shape}", rule)
    if (large := np.percentile(np.abs(poses[:, 3 : 3 * BODY]), 99)) > _LARGEST:
        raise InputError(f"{path}, {' and '.join(parts)}", f"angles of {large:.3g}", "must be radians, not degrees")
    return poses, trans


def _without_padding(poses: np.ndarray, trans: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Without the zeros with which batches fill up short motions, and what to say of them; zeros alone are a motion."""
    moved = np.flatnonzero(poses.any(1) | trans.any(1))
    if not len(moved) or (empty := len(poses) - 1 - int(moved[-1])) == 0:
        return poses, trans, []
    kept = slice(len(poses) - empty)
    return poses[kept], trans[kept], [f"the last {empty} frames are all zero and were left out"]


def _rate(path: Path, arrays: dict[str, np.ndarray]) -> float:
    for key in _RATES:
        if key in arrays and arrays[key].size == 1 and arrays[key].dtype.kind in "fiu":
            rate = float(arrays[key].reshape(()))
            if not 0 < rate < float("inf"):
                raise InputError(f"{path}, {key}", rate, "must be a number above 0")
            return rate
    raise InputError(path, "no mocap_framerate", "SMPL poses need a rate: fps=, --fps")


def _check_metres(path: Path, pelvis: np.ndarray, rate: float) -> None:
    """InputError where the pelvis (T, 3), y up, is as fast or as high as nobody's half of the time."""
    steps = np.linalg.norm(np.diff(pelvis, axis=0), axis=-1) if len(pelvis) > 1 else np.zeros(1)
    speed, height = float(np.median(steps)) * rate, float(np.median(np.abs(pelvis[:, 1])))
    if speed > _FASTEST or height > _HIGHEST:
        shown = f"{speed:.3g} units a second, {height:.3g} high"
        raise InputError(f"{path}, trans", shown, "must be in metres (divide by 1000, or by 100)")


def _rest(
    path: Path, arrays: dict[str, np.ndarray], options: ReadingOptions
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Offsets (22, 3) of the joints, where the pelvis is when trans is 0, and what to say of it."""
    if options.body is None:
        return SMPL_OFFSETS, SMPL_ROOT, []
    body, notes = read_body(options.body), []
    if "betas" not in arrays:
        notes.append("it holds no betas, so that the body has the model's mean shape")
    betas = arrays.get("betas", np.zeros(1))
    if betas.ndim not in (1, 2) or betas.size == 0 or not np.isfinite(betas).all():
        raise InputError(f"{path}, betas", f"{betas.dtype} {betas.shape}", "must be finite numbers (n,) or (T, n)")
    rows = np.atleast_2d(betas).astype(np.float64)
    if np.ptp(rows, axis=0).max() > _SAME_SHAPE:
        notes.append("its betas change over time; the first ones were taken")
    if (rows[0, body.shapes.shape[-1] :] != 0).any():
        notes.append(
            f"it has {rows.shape[1]} betas and the body model {body.shapes.shape[-1]}; the others were left out"
        )
    joints = body.joints(rows[0])
    offsets = joints - joints[[0, *Skeleton.named("smpl22").parents[1:]]]
    return offsets, joints[0], notes


def _moved(offsets: np.ndarray, root: np.ndarray) -> np.ndarray:
    """(T, 22, 3) translations: the root's places (T, 3), and the offsets of all others."""
    moved = np.repeat(offsets[None], len(root), axis=0)
    moved[:, 0] = root
    return moved
