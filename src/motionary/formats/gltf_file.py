"""glTF 2.0 files (.glb, .gltf): their JSON, nodes and arrays, each checked before it is used.

Reference: Khronos, glTF 2.0 specification. A count is compared with the bytes that are there before memory is taken,
and of a buffer nothing is read but what is asked for: most of it is meshes and images, or a hole.
"""

from __future__ import annotations

import base64
import binascii
import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from motionary.errors import InputError, is_real
from motionary.files import readable
from motionary.formats.gltf_container import RULE, chunks, parsed
from motionary.motion.rotations import rotmat_to_unitquat
from motionary.motion.skeleton import MOST_JOINTS

GENERATOR = "motionary"  # the generator that our own files name
_MOST_NODES = 20_000
_MOST_NUMBERS, _MOST_AT_ONCE = 1 << 26, 1 << 24  # that are read of a file and of an accessor, 8 bytes each
_LARGEST = 1 << 28  # bytes that are read at once
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True)
class GltfNode:
    """A node at rest.

    Attributes:
        name: "node<i>" where it has none.
        children: indices of its nodes.
        translation, rotation, scale: (3,), (4,) unit quaternion xyzw, (3,); of its matrix where it has one.
    """

    name: str
    children: tuple[int, ...]
    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True)
class _Buffer:
    """Where the bytes of a buffer are: in memory, or some of a file."""

    source: bytes | Path
    place: range

    def read(self, start: int, length: int) -> bytes:
        """Bytes from `start` on."""
        if isinstance(self.source, bytes):
            return self.source[start : start + length]
        with self.source.open("rb") as file:
            file.seek(self.place.start + start)
            return file.read(length)


@dataclass
class GltfFile:
    """A glTF file whose parts are read, and checked, as they are asked for.

    Attributes:
        path: names it in errors.
        document: its JSON.
        size: bytes of the JSON and of what was read of buffers.
        binary: which bytes of the file are a .glb's buffer.
    """

    path: Path
    document: dict[str, Any]
    size: int
    binary: range
    _numbers: int = 0  # that were read
    _seen: set[tuple[int, int, int]] = field(default_factory=set, repr=False)  # what `size` counts
    _buffers: dict[int, _Buffer] = field(default_factory=dict, repr=False)
    _lists: dict[str, list[dict[str, Any]]] = field(default_factory=dict, repr=False)

    @staticmethod
    def read(path: str | os.PathLike) -> GltfFile:
        """Open a .glb or .gltf file.

        Raises:
            InputError: not glTF 2.0, or it needs an extension that packs its buffers.
        """
        path = readable(path)
        with path.open("rb") as file:
            binary = file.read(4) == b"glTF"
            file.seek(0)
            size = path.stat().st_size
            document, size, place = chunks(path) if binary else (parsed(path, file, size), size, range(0))
        asset = document.get("asset")
        version = asset.get("version") if isinstance(asset, dict) else None
        if not str(version).startswith("2."):
            raise InputError(path, f"version {version}", RULE)
        return GltfFile(path, document, size, place)

    @property
    def data(self) -> bytes:
        """The whole binary buffer of a .glb; InputError where it is larger than those of characters are."""
        if (size := len(self.binary)) > _LARGEST:
            raise self.wrong("buffer 0", f"{size:,} bytes", f"a character's may have {_LARGEST:,} (is it damaged?)")
        return _Buffer(self.path, self.binary).read(0, size)

    def wrong(self, what: str, value: object, rule: str) -> InputError:
        """The complaint about a part of the file."""
        return InputError(f"{self.path}, {what}", value, rule)

    def entries(self, key: str, holder: dict[str, Any] | None = None, where: str = "") -> list[dict[str, Any]]:
        """The objects of a list of the document, or of a part of it; none where it is absent."""
        if holder is None and key in self._lists:
            return self._lists[key]
        found = (self.document if holder is None else holder).get(key, [])
        if not isinstance(found, list) or not all(isinstance(entry, dict) for entry in found):
            raise self.wrong(f"{where}{key}", found, "must be a list of objects")
        if holder is None:
            self._lists[key] = found
        return found

    def index(self, value: object, count: int, what: str) -> int:
        """A whole number below `count`."""
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < count:
            raise self.wrong(what, value, f"must be a whole number below {count}")
        return value

    def numbers(self, values: object, count: int, what: str) -> np.ndarray:
        """(count,) finite numbers of the JSON."""
        if not isinstance(values, list) or len(values) != count or not all(map(is_real, values)):
            raise self.wrong(what, values, f"must be {count} finite numbers")
        return np.array(values, np.float64)

    @cached_property
    def nodes(self) -> list[GltfNode]:
        """All nodes."""
        entries = self.entries("nodes")
        if len(entries) > _MOST_NODES:
            raise self.wrong("nodes", len(entries), f"must be at most {_MOST_NODES:,}")
        return [self._node(i, entry, len(entries)) for i, entry in enumerate(entries)]

    @cached_property
    def parents(self) -> dict[int, int]:
        """The parent of each node that has one; the nodes are trees."""
        found: dict[int, int] = {}
        for i, node in enumerate(self.nodes):
            for child in node.children:
                if child in found or child == i:
                    raise self.wrong(f"node {i}, children", child, "must be a tree: no node has two parents")
                found[child] = i
        free = {i for i in range(len(self.nodes)) if i not in found}
        stack = list(free)
        while stack:
            children = self.nodes[stack.pop()].children
            free.update(children)
            stack += children
        if len(free) < len(self.nodes):
            raise self.wrong("nodes", f"{len(self.nodes) - len(free)} in a circle", "must be trees")
        return found

    @cached_property
    def skins(self) -> list[list[int]]:
        """The joints of each skin."""
        found = []
        for i, skin in enumerate(self.entries("skins")):
            joints = skin.get("joints")
            if not isinstance(joints, list) or not 0 < len(joints) <= MOST_JOINTS:
                raise self.wrong(f"skin {i}, joints", joints, f"must be a list of 1 to {MOST_JOINTS} nodes")
            found.append([self.index(joint, len(self.nodes), f"skin {i}, joints") for joint in joints])
        return found

    def inverse_bind(self) -> dict[int, np.ndarray]:
        """(4, 4) by node, of the first skin where it has them, and they can be turned back."""
        skins = self.entries("skins")
        if not skins or "inverseBindMatrices" not in skins[0]:
            return {}
        values = self.accessor(skins[0]["inverseBindMatrices"], 16, "skin 0, inverseBindMatrices")
        matrices = values.reshape(-1, 4, 4).transpose(0, 2, 1)
        good = np.abs(np.linalg.det(matrices)) > 1e-12
        return {node: matrix for node, matrix, can in zip(self.skins[0], matrices, good, strict=False) if can}

    def _node(self, i: int, entry: dict[str, Any], count: int) -> GltfNode:
        where, name, children = f"node {i}", entry.get("name"), entry.get("children", [])
        if not isinstance(children, list):
            raise self.wrong(f"{where}, children", children, "must be a list of nodes")
        below = tuple(self.index(child, count, f"{where}, children") for child in children)
        if "matrix" in entry:
            matrix = self.numbers(entry["matrix"], 16, f"{where}, matrix").reshape(4, 4).T
            scale = np.linalg.norm(matrix[:3, :3], axis=0)
            if np.linalg.det(matrix[:3, :3]) < 0:
                scale = -scale
            turn = rotmat_to_unitquat(matrix[:3, :3] / np.where(scale == 0, 1, scale))
            move = matrix[:3, 3]
        else:
            move = self.numbers(entry.get("translation", [0, 0, 0]), 3, f"{where}, translation")
            turn = self.numbers(entry.get("rotation", [0, 0, 0, 1]), 4, f"{where}, rotation")
            scale = self.numbers(entry.get("scale", [1, 1, 1]), 3, f"{where}, scale")
        if not (length := float(np.linalg.norm(turn))) > 1e-6 or not np.isfinite(turn).all():
            raise self.wrong(f"{where}, rotation", turn.tolist(), "must be a unit quaternion")
        return GltfNode(
            name if isinstance(name, str) and name.strip() else f"node{i}", below, move, turn / length, scale
        )

    def accessor(self, index: object, width: int, what: str) -> np.ndarray:
        """The values (n, width) float64 of an accessor; whole numbers that stand for fractions are made these.

        Args:
            index: of the accessor.
            width: numbers a value must have.
            what: names it in errors.

        Raises:
            InputError: no such accessor, another kind of values, more than its buffer holds, or not finite.
        """
        entries = self.entries("accessors")
        entry = entries[self.index(index, len(entries), what)]
        kind, component = entry.get("type"), entry.get("componentType")
        dtype = _COMPONENTS.get(component) if isinstance(component, int) else None
        if not isinstance(kind, str) or _WIDTHS.get(kind) != width or dtype is None:
            raise self.wrong(what, f"{kind} of {component}", f"must be glTF's numbers, {width} a value")
        if "sparse" in entry or "bufferView" not in entry:
            raise self.wrong(what, "sparse", "accessors without plain data are not read: export without sparse ones")
        number = np.dtype(dtype)
        count = self._count(entry, "count", f"{what}, count")
        values = self._view(entry["bufferView"], self._count(entry, "byteOffset", what, 0), count, width, number, what)
        found = values.astype(np.float64)
        if entry.get("normalized") is True and number.kind in "iu":
            found = np.maximum(found / np.iinfo(number).max, -1)
        if not np.isfinite(found).all():
            raise self.wrong(what, "not finite", "must be finite numbers")
        return found

    def _view(self, index: object, offset: int, count: int, width: int, number: np.dtype, what: str) -> np.ndarray:
        views = self.entries("bufferViews")
        view = views[self.index(index, len(views), f"{what}, bufferView")]
        if "extensions" in view:
            raise self.wrong(what, ", ".join(map(str, view["extensions"])), "packed buffers are not read: unpack them")
        buffer, at = self._buffer(view.get("buffer"), what)
        start, length = self._count(view, "byteOffset", what, 0), self._count(view, "byteLength", what)
        size = width * number.itemsize
        stride = self._count(view, "byteStride", what, size) or size
        needed = offset + (count - 1) * stride + size if count else 0
        if stride < size or needed > length or start + length > len(buffer.place):
            rule = f"must lie within its buffer of {len(buffer.place):,} bytes (truncated?)"
            raise self.wrong(what, f"{count} values of {size} bytes", rule)
        taken = max(needed - offset, 0)
        self._numbers += count * width
        if count * width > _MOST_AT_ONCE or self._numbers > _MOST_NUMBERS or taken > _LARGEST:
            rule = f"may be {_MOST_AT_ONCE:,} numbers, {_MOST_NUMBERS:,} with all others of the file; cut it into parts"
            raise self.wrong(what, f"{count:,} values in {taken:,} bytes", rule)
        if (place := (at, start + offset, taken)) not in self._seen:  # accessors may lie on the same bytes
            self._seen.add(place)
            self.size += taken
        return np.ndarray((count, width), number, buffer.read(start + offset, taken), 0, (stride, number.itemsize))

    def _count(self, entry: dict[str, Any], key: str, what: str, otherwise: int | None = None) -> int:
        value = entry.get(key, otherwise)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 40:
            raise self.wrong(f"{what}, {key}", value, "must be a whole number of at least 0")
        return value

    def _buffer(self, index: object, what: str) -> tuple[_Buffer, int]:
        """A buffer and its index."""
        buffers = self.entries("buffers")
        at = self.index(index, len(buffers), f"{what}, buffer")
        if at not in self._buffers:
            given = buffers[at].get("uri") is not None
            self._buffers[at] = self._found(buffers[at], f"buffer {at}") if given else _Buffer(self.path, self.binary)
        return self._buffers[at], at

    def _found(self, buffer: dict[str, Any], what: str) -> _Buffer:
        """A buffer written into the JSON, or as many bytes as it says of a file beside it, which may hold more."""
        uri = buffer["uri"]
        if not isinstance(uri, str):
            raise self.wrong(f"{what}, uri", uri, "must be text")
        if uri.startswith("data:"):
            kind, _, text = uri.partition(",")
            try:
                data = base64.b64decode(text if kind.endswith(";base64") else "*", validate=True)
            except (binascii.Error, ValueError):
                raise self.wrong(f"{what}, uri", uri[:40], "must be base64") from None
            return _Buffer(data, range(len(data)))
        file = self.path.parent / unquote(uri)
        try:
            here = file.resolve().is_relative_to(self.path.parent.resolve()) and file.is_file()
        except (OSError, RuntimeError, ValueError):  # a name that no file can have, or a circle of links
            here = False
        if ":" in uri or not here:
            raise self.wrong(f"{what}, uri", uri, "must be a file in the folder of the .gltf")
        length = self._count(buffer, "byteLength", what)
        return _Buffer(file, range(min(length, readable(file).stat().st_size)))
