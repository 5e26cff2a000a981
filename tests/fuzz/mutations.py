"""Inputs as no program should write them: small good files of every format, each changed by a seed."""

from __future__ import annotations

import base64
import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
from acclaim_files import HEADER
from c3d_files import c3d_bytes

from motionary.formats import write_motion
from motionary.formats.gltf_container import packed
from motionary.formats.gltf_file import GltfFile
from motionary.motion import Motion, Skeleton

NUMBERS = ("nan", "inf", "-1e308", "1e400", "1e30", "1e-320", "9" * 400, "0", "-1", "", "0x10", "1_0", "\u00b2", "1,5")
VALUES = (
    None,
    True,
    [],
    {},
    "",
    "\ud83d",
    "a" * 5000,
    -1,
    10**400,
    1e308,
    float("nan"),
    [[[[1]]]],
    "../../x.bvh",
    "\0",
)
DTYPES = ("<f2", ">f8", "<i1", "<u8", "<c16", "<U8", "|S4", "|b1", "<M8[s]", "V12", "<f4")
KINDS = ("bvh", "amc", "asf", "npy", "npz", "amass", "glb", "gltf", "c3d", "clips", "mapping", "humanml3d")


def motion(frames: int = 12) -> Motion:
    """A person who walks ahead and sways."""
    skeleton, time = Skeleton.named("smpl22"), np.arange(frames)[:, None, None] / 20
    sway = 0.05 * np.sin(6 * time + np.arange(66).reshape(22, 3)) * (np.arange(22) > 0)[:, None]
    return Motion(skeleton.rest + [0, 0.95, 0] + sway + time * [0, 0, 1.0], 20, skeleton)


def mutant(seed: int, folder: Path) -> Path:
    """The file or folder of a seed; equal seeds make equal bytes."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    return _MAKERS[kind](rng, folder)


def _bytes(rng: np.random.Generator, data: bytes) -> bytes:
    """A few bytes flipped, cut, doubled, or put in."""
    changed = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        at, length = int(rng.integers(len(changed) or 1)), int(rng.integers(1, 200))
        how = rng.integers(5)
        if how == 0:
            for k in range(at, min(at + int(rng.integers(1, 8)), len(changed))):
                changed[k] ^= 1 << int(rng.integers(8))
        elif how == 1:
            del changed[at:]
        elif how == 2:
            changed[at:at] = changed[at : at + length] * int(rng.integers(1, 50))
        elif how == 3:
            changed[at : at + length] = rng.bytes(length)
        else:
            del changed[at : at + length]
    return bytes(changed)


def _text(rng: np.random.Generator, text: str) -> bytes:
    """Words replaced by strange numbers, lines lost, moved or repeated; or what `_bytes` does."""
    how = rng.integers(6)
    if how == 0:
        return _bytes(rng, text.encode())
    lines = text.split("\n")
    for _ in range(rng.integers(1, 4)):
        i = int(rng.integers(len(lines)))
        words = lines[i].split(" ")
        if how in (1, 2):
            words[int(rng.integers(len(words)))] = str(rng.choice(NUMBERS))
            lines[i] = " ".join(words)
        elif how == 3:
            lines[i:i] = [lines[i]] * int(rng.choice([1, 3, 3000]))
        elif how == 4:
            lines.insert(int(rng.integers(len(lines))), lines.pop(i))
        else:
            lines[i] = " ".join(words[:500] * int(rng.choice([2, 20, 300])))
    return (" " if rng.random() < 0.1 else "\n").join(lines).encode()


def _array(rng: np.random.Generator, good: np.ndarray) -> bytes:
    """A .npy with another dtype, shape, header or strange values."""
    how, array = rng.integers(5), good.copy()
    if how == 0:
        array.reshape(-1)[rng.integers(array.size)] = rng.choice([np.nan, np.inf, 1e30, 1e-40])
    elif how == 1:
        array = array * float(rng.choice([1e-40, 1e-9, 1e6, 1e9, 1e36, 0]))
    file = io.BytesIO()
    np.save(file, array)
    data = file.getvalue()
    if how == 2:
        data = data.replace(b"'<f4'", f"'{rng.choice(DTYPES)}'".encode())
    elif how == 3:
        shape = tuple(int(n) for n in rng.choice([0, 1, 3, 22, -1, 10**6, 2**40, 2**63, 10**30], rng.integers(0, 5)))
        header = f"{{'descr': '<f4', 'fortran_order': {bool(rng.integers(2))}, 'shape': {shape}, }}"
        header += " " * (63 - (len(header) + 10) % 64) + "\n"
        data = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + good.tobytes()
    return data if how < 4 else _bytes(rng, data)


def _values(rng: np.random.Generator, values: dict) -> dict:
    """Keys given strange values, lost, or joined by unknown ones."""
    for _ in range(rng.integers(1, 3)):
        key = str(rng.choice([*values, "extra"]))
        values = {**values, key: VALUES[rng.integers(len(VALUES))]}
    return values


def _npz(rng: np.random.Generator, folder: Path, arrays: dict[str, np.ndarray]) -> Path:
    path = folder / "case.npz"
    members = {}
    chosen = str(rng.choice(list(arrays)))
    for name, array in arrays.items():
        file = io.BytesIO()
        np.save(file, array)
        members[name] = file.getvalue()
    numeric = arrays[chosen].dtype.kind in "fiu"
    if (array_like := rng.random() < 0.4) and numeric:
        members[chosen] = _array(rng, np.asarray(arrays[chosen], np.float32).reshape(-1, 1))
    elif chosen == "skeleton" and rng.random() < 0.7:
        file = io.BytesIO()
        np.save(file, np.array(json.dumps(_values(rng, json.loads(str(arrays[chosen]))))))
        members[chosen] = file.getvalue()
    method = int(rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]))
    with zipfile.ZipFile(path, "w", method if array_like else zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    if rng.random() < 0.5:
        data = bytearray(path.read_bytes())
        entry = data.find(b"PK\x01\x02")  # the list of members: versions, flags, methods, sizes
        data[entry + int(rng.integers(4, 46))] = int(rng.integers(256))
        path.write_bytes(data if rng.random() < 0.6 else _bytes(rng, bytes(data)))
    return path


def _saved(folder: Path, extension: str) -> Path:
    return write_motion(motion(), folder / f"good.{extension}")


def _bvh(rng: np.random.Generator, folder: Path) -> Path:
    path = folder / "case.bvh"
    path.write_bytes(_text(rng, _saved(folder, "bvh").read_text()))
    return path


def _document(rng: np.random.Generator, document: dict) -> dict:
    """glTF's JSON with strange values in one of its parts, or in a part of that."""
    part = str(rng.choice(list(document)))
    if rng.random() < 0.4:  # most that can be wrong of a motion is wrong in these
        part = str(rng.choice(["animations", "accessors", "bufferViews", "nodes", "skins"]))
    found = document[part]
    while isinstance(found, list) and found and isinstance(found[0], dict):
        at = int(rng.integers(len(found)))
        inner = [value for value in found[at].values() if isinstance(value, list) and value]
        if not inner or not isinstance(inner[0][0], dict) or rng.random() < 0.3:
            found[at] = _values(rng, found[at])
            return document
        found = inner[int(rng.integers(len(inner)))]
    document[part] = VALUES[rng.integers(len(VALUES))]
    return document


def _glb(rng: np.random.Generator, folder: Path) -> Path:
    path = folder / "case.glb"
    data = _saved(folder, "glb").read_bytes()
    if rng.random() < 0.6:
        file = GltfFile.read(folder / "good.glb")
        document, buffer = file.document, file.data
        path.write_bytes(packed(_document(rng, document), buffer))
    else:
        path.write_bytes(_bytes(rng, data))
    return path


def _gltf(rng: np.random.Generator, folder: Path) -> Path:
    """As text with the buffer in it, of which a part is a matter of chance too."""
    file = GltfFile.read(_saved(folder, "glb"))
    document, buffer = file.document, file.data
    if rng.random() < 0.3:
        buffer = _bytes(rng, buffer)
    document["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{base64.b64encode(buffer).decode()}"
    text = json.dumps(_document(rng, document) if rng.random() < 0.7 else document, indent=1)
    (folder / "case.gltf").write_bytes(text.encode() if rng.random() < 0.6 else _text(rng, text))
    return folder / "case.gltf"


_ASF = (
    HEADER
    + """\
:bonedata
  begin
    id 1
    name lhip
    direction 0.5 -0.8 0.0
    length 2.4
    axis 0 0 20 XYZ
    dof rx ry rz
  end
  begin
    id 2
    name lfemur
    direction 0.3 -0.9 0.0
    length 7.1
    axis 0 0 20 XYZ
    dof rx
  end
:hierarchy
  begin
    root lhip
    lhip lfemur
  end
"""
)
_AMC = ":FULLY-SPECIFIED\n:DEGREES\n" + "".join(
    f"{i}\nroot 0 {15 + i} 0 0 {i} 0\nlhip {i} 2 3\nlfemur {-i}\n" for i in range(1, 9)
)


def _amc(rng: np.random.Generator, folder: Path) -> Path:
    (folder / "case.asf").write_text(_ASF)
    (folder / "case.amc").write_bytes(_text(rng, _AMC))
    return folder / "case.amc"


def _asf(rng: np.random.Generator, folder: Path) -> Path:
    (folder / "case.asf").write_bytes(_text(rng, _ASF))
    (folder / "case.amc").write_text(_AMC)
    return folder / "case.amc"


def _npy(rng: np.random.Generator, folder: Path) -> Path:
    good = rng.choice(3)
    array = motion().positions if good else np.zeros((12, 263), np.float32)
    (folder / "case.npy").write_bytes(_array(rng, array))
    return folder / "case.npy"


def _ours(rng: np.random.Generator, folder: Path) -> Path:
    with np.load(_saved(folder, "npz")) as found:
        return _npz(rng, folder, dict(found))


def _amass(rng: np.random.Generator, folder: Path) -> Path:
    poses = rng.normal(size=(12, 156)) * 0.1
    arrays = {"poses": poses, "trans": np.zeros((12, 3)), "mocap_framerate": np.array(60.0), "gender": np.array("male")}
    return _npz(rng, folder, arrays)


def _clips(rng: np.random.Generator, folder: Path) -> Path:
    root = folder / "case"
    root.mkdir()
    write_motion(motion(60), root / "a.npz")
    write_motion(motion(60), root / "b.npz")
    captions = [{"text": "a person walks", "start": 0.0, "end": 2.0, "source": "x"}]
    good = {"motion": "a.npz", "fps": 20, "subject": "s", "style": "calm", "action": "walk", "captions": captions}
    bad = _values(rng, {**good, "motion": "b.npz"})
    if rng.random() < 0.4:
        bad = {**good, "motion": "b.npz", "captions": [_values(rng, captions[0])]}
    line = json.dumps(bad).encode()
    line = _bytes(rng, line).replace(b"\n", b" ") if rng.random() < 0.3 else line
    (root / "clips.jsonl").write_bytes(json.dumps(good).encode() + b"\n" + line + b"\n")
    return root


def _mapping(rng: np.random.Generator, folder: Path) -> Path:
    root = folder / "case"
    root.mkdir()
    write_motion(motion(60), root / "a.npz")
    mapping = {"pelvis": "pelvis", "head": "head", "up": "y", "unit": "m", "mirror": False, "skip_first": False}
    text = json.dumps(_values(rng, mapping))
    (root / "mapping.json").write_bytes(_text(rng, text) if rng.random() < 0.4 else text.encode())
    return root


def _humanml3d(rng: np.random.Generator, folder: Path) -> Path:
    root = folder / "case"
    for name in ("new_joints", "texts"):
        (root / name).mkdir(parents=True)
    for name in ("000001", "000002"):
        write_motion(motion(60), root / "new_joints" / f"{name}.npy")
        (root / "texts" / f"{name}.txt").write_text("a person walks#a/DET person/NOUN walk/VERB#0.0#0.0\n")
    (root / "train.txt").write_text("000001\n000002\n")
    victim = str(rng.choice(["texts/000002.txt", "train.txt", "new_joints/000002.npy"]))
    data = (root / victim).read_bytes()
    data = _array(rng, motion(60).positions) if victim.endswith("npy") else _text(rng, data.decode())
    (root / victim).write_bytes(data + (b"\n000001\n" if victim == "train.txt" else b""))
    return root


def _c3d(rng: np.random.Generator, folder: Path) -> Path:
    path, good = folder / "case.c3d", motion()
    data = c3d_bytes(good.skeleton.joints, good.positions[..., [0, 2, 1]] * [1000, -1000, 1000], good.fps)
    head = 1024 + 512 * int(rng.integers(4))  # where the file says what it holds
    path.write_bytes(_bytes(rng, data) if rng.random() < 0.3 else _bytes(rng, data[:head]) + data[head:])
    return path


_MAKERS = {
    "bvh": _bvh,
    "amc": _amc,
    "asf": _asf,
    "npy": _npy,
    "npz": _ours,
    "amass": _amass,
    "glb": _glb,
    "gltf": _gltf,
    "c3d": _c3d,
    "clips": _clips,
    "mapping": _mapping,
    "humanml3d": _humanml3d,
}
