"""The released HumanML3D and KIT-ML layout: new_joints/, new_joint_vecs/, texts/, train.txt, val.txt, test.txt."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motionary.corpus.checks import unforeseen
from motionary.corpus.clips import Caption, Clip, check_text
from motionary.corpus.splits import SPLITS
from motionary.errors import InputError
from motionary.features import HumanML3D
from motionary.formats import read_motion
from motionary.formats.read.numpy_files import npy_shape, read_npy
from motionary.motion import Motion, Skeleton, repeat_last_step

# Joints -> what the two releases are: HumanML3D (SMPL joints, 20 fps) and KIT-ML (12.5 fps).
RELEASES = {22: ("smpl22", 20.0), 21: ("kit21", 12.5)}
_LONGEST_NAME = 200  # no disk holds longer ones
TALLEST = 10.0  # m; KIT-ML is released in millimetres, and nobody is this tall in metres


@dataclass(frozen=True)
class ReleasedMotion:
    """Loader of `new_joints/<name>.npy` (T, J, 3) or, where that is absent, `new_joint_vecs/<name>.npy` (T, D).

    Both have as many frames, since the joints were made from the features; it takes one more to encode all of them.
    """

    path: str
    features: bool = False  # the file holds HumanML3D's features, whatever codec the corpus has

    def __call__(self, clip: Clip) -> tuple[Motion, Clip]:
        name, fps = self._release(npy_shape(Path(self.path)))
        skeleton = Skeleton.named(name)
        if self.features:
            features = read_npy(Path(self.path)).astype(np.float32)
            motion = HumanML3D(skeleton).decode(features, fps=fps)
        else:
            # The release is metres and y up by definition (KIT-ML's original is in millimetres, see below).
            motion = read_motion(self.path, fps=fps, skeleton=skeleton, up="y", unit=1.0, mirror=False)
        extent = np.ptp(motion.positions[0], axis=0).max()
        if extent > TALLEST:
            motion = Motion(motion.positions / 1000, motion.fps, motion.skeleton)
        return repeat_last_step(motion), clip

    def _release(self, shape: tuple[int, ...]) -> tuple[str, float]:
        for joints, (name, fps) in RELEASES.items():
            if shape[1:] == ((HumanML3D(Skeleton.named(name)).dim,) if self.features else (joints, 3)):
                return name, fps
        rule = "must be (T, 22, 3) or (T, 21, 3) joints, or their (T, 263) or (T, 251) features"
        raise InputError(self.path, shape, rule)


class HumanML3DSource:
    """A folder in the released layout.

    Every motion that a split file names is a clip with that split. `M<name>` is the release's own mirrored copy of
    `<name>`: it keeps its split and gets no second copy. Captions are lines `text#tagged words#from#to`; from = to = 0
    or nan means the whole clip. The tagged words are the normalized caption.
    """

    def __init__(self, root: Path, name: str):
        self.root, self.name = root, name

    def clips(self) -> tuple[list[Clip], list[InputError]]:
        """See `sources.Source`; InputError where a folder of the release is missing."""
        self._check_folders()
        split_of, problems = self._splits()
        mirrored = {name for name in split_of if name.startswith("M") and name[1:] in split_of}
        found = []
        for name, split in sorted(split_of.items()):
            try:
                origin = name[1:] if name in mirrored else name
                found.append(
                    Clip(
                        id=f"{self.name}/{name}",
                        load=self._motion(name),
                        where=str(self.root / "texts" / f"{name}.txt"),
                        group=self.name,
                        captions=tuple(self._captions(name, problems)),
                        split=split,
                        origin=f"{self.name}/{origin}",
                        mirrored=name in mirrored,
                        mirrors=name not in mirrored and f"M{name}" not in split_of,
                    )
                )
            except InputError as problem:
                problems.append(problem)
            except Exception as error:  # one bad name never ends a run
                problems.append(unforeseen(self.root / "texts" / f"{name}.txt", error))
        return found, problems

    def _check_folders(self) -> None:
        """A release that was not unpacked whole is one error, not one for each of its motions."""
        if not (self.root / "texts").is_dir():
            raise InputError(self.root / "texts", "missing", "must hold the captions; unpack the release's texts.zip")
        if not any((self.root / name).is_dir() for name in ("new_joints", "new_joint_vecs")):
            rule = "must hold the motions, as must new_joint_vecs; the release says how to make them"
            raise InputError(self.root / "new_joints", "missing", rule)

    def _splits(self) -> tuple[dict[str, str], list[InputError]]:
        split_of: dict[str, str] = {}
        problems = []
        for split in SPLITS:
            path = self.root / f"{split}.txt"
            if not path.is_file():
                continue
            for number, line in enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), 1):
                name = line.strip()
                if not name:
                    continue
                if name in split_of:
                    problems.append(InputError(f"{path}:{number}", name, f"duplicate id, already in {split_of[name]}"))
                elif "/" in name or name.startswith(".") or len(name) > _LONGEST_NAME:
                    problems.append(InputError(f"{path}:{number}", name, "must be the bare name of a motion"))
                else:
                    split_of[name] = split
        if not split_of:
            rule = "must hold train.txt, val.txt and test.txt with one motion name a line"
            raise InputError(self.root, "no split files", rule)
        return split_of, problems

    def _motion(self, name: str) -> ReleasedMotion:
        joints = self.root / "new_joints" / f"{name}.npy"
        features = self.root / "new_joint_vecs" / f"{name}.npy"
        for path in (joints, features):
            if path.is_file():
                return ReleasedMotion(str(path), features=path == features)
        raise InputError(joints, name, "is listed but absent, as are its features in new_joint_vecs")

    def _captions(self, name: str, problems: list[InputError]):
        path = self.root / "texts" / f"{name}.txt"
        if not path.is_file():
            problems.append(InputError(path, "missing", "every listed motion needs a caption file"))
            return
        for number, line in enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), 1):
            if not line.strip():
                continue
            try:
                yield released_caption(line, f"{path}:{number}")
            except InputError as problem:
                problems.append(problem)


def released_caption(line: str, where: str) -> Caption:
    """A line of texts/<item>.txt: caption#tagged words#from#to; InputError where it is none."""
    parts = line.strip().split("#")
    # A caption may itself hold "#"; the last three fields are fixed.
    if len(parts) < 4:
        raise InputError(where, line, "must be caption#tagged words#from#to")
    text = check_text("#".join(parts[:-3]), where)
    try:
        start, end = float(parts[-2]), float(parts[-1])
    except ValueError:
        raise InputError(where, "#".join(parts[-2:]), "from and to must be seconds") from None
    tokens = tuple(token for token in parts[-3].split() if "/" in token.strip("/"))
    if math.isnan(start) or math.isnan(end) or start == end == 0:
        return Caption(text, source="humanml3d", tokens=tokens)
    return Caption(text, start, end, "humanml3d", tokens)
