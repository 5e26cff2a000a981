"""The text of a BVH file as arrays, and back: hierarchy, channels, numbers. What they mean is bvh.py's business."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np

from motionary.errors import InputError
from motionary.formats.number_rows import LONGEST_LINE, Told, number_rows, numbers_of, text_end, text_lines, with_points
from motionary.formats.read.extent import FARTHEST, check_extent
from motionary.formats.read.frame_rate import rounding
from motionary.motion.skeleton import MOST_JOINTS
from motionary.text_files import decoded

CHANNELS = {f"{axis}{kind}": (kind, i) for kind in ("position", "rotation") for i, axis in enumerate("xyz")}
_COUNTS = tuple("0123456")
_HEADER = ("frames", "frame time")
_LONGEST_HEAD = 1 << 22  # bytes; a hierarchy of as many joints as there may be takes less


@dataclass
class Node:
    """A joint (or an end site, which has no channels) as the file gives it."""

    name: str
    parent: int
    end: bool = False
    offset: tuple[float, ...] | None = None
    channels: list[tuple[str, int]] = field(default_factory=list)


@dataclass
class RawBVH:
    """The contents of a BVH file whose numbers are read as they are asked for.

    Attributes:
        nodes: in file order.
        frame_time: seconds per frame.
        rounded: by how much that may be off, as its digits say.
        frames: as many as the file says; it may hold more.
        rows: pieces (n, all channels) of the numbers, in order, while the file is open.
        notes: what is odd; whole when all rows were read.
    """

    nodes: list[Node]
    frame_time: float
    rounded: float
    frames: int
    rows: Iterator[np.ndarray]
    notes: list[str] = field(default_factory=list)


def parse(file: BinaryIO, name: object, told: Told = lambda count: None) -> RawBVH:
    """Parse a BVH file.

    Args:
        file: its bytes, as `text_stream` opens them; it stays open until the rows were read.
        name: what to call the file in errors.
        told: is told of bytes that were read.

    Raises:
        InputError: names the file, the line and the rule that it breaks; of its numbers, as they are read.
    """
    end = text_end(file, name)
    head = head_of(file, end)
    if len(head) > _LONGEST_HEAD:
        rule = "a BVH file starts with HIERARCHY, MOTION, 'Frames:' and 'Frame Time:'"
        raise InputError(name, f"no 'Frame Time:' in {_LONGEST_HEAD:,} bytes", rule)
    told(len(head))
    lines = decoded(head).splitlines()
    nodes, at = _hierarchy(lines, name)
    frames, time, exact = _header(lines, at, name)
    if not any(node.channels for node in nodes):
        raise InputError(name, "no CHANNELS", "at least one joint must move")
    raw = RawBVH(nodes, time, exact, frames, iter(()))
    raw.rows = _rows(raw, _Numbers(file, len(head), end, len(lines)), name, told)
    return raw


def head_of(file: BinaryIO, end: int) -> bytes:
    """The lines of a file before the first one of numbers, up to byte `end` at most, or up to the first that makes
    them longer than any hierarchy."""
    lines, keys, length = [], set(), 0
    file.seek(0)
    for line in text_lines(file, end):
        lines.append(line)
        length += len(line)
        if length > _LONGEST_HEAD:
            break
        keys.add(_key(line.partition(b":")[0].decode("latin-1")))
        if set(_HEADER) <= keys:
            break
    return b"".join(lines)


@dataclass(frozen=True)
class _Numbers:
    """Where a file's numbers stand: from byte `start` to `end`, after `lines` lines."""

    file: BinaryIO
    start: int
    end: int
    lines: int


def _fail(name: object, line: int, value: object, rule: str) -> InputError:
    return InputError(f"{name}, line {line + 1}", value, rule)


def _floats(tokens: list[str], count: int, name: object, line: int, what: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(with_points(token)) for token in tokens)
    except ValueError:
        raise _fail(name, line, " ".join(tokens), f"{what} must be numbers") from None
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise _fail(name, line, " ".join(tokens), f"{what} must be {count} finite number{'s' * (count > 1)}")
    return numbers


def _hierarchy(lines: list[str], name: object) -> tuple[list[Node], int]:
    """The nodes before the line MOTION, and that line's index."""
    nodes: list[Node] = []
    stack: list[int] = []  # the open braces' nodes
    pending: Node | None = None  # a node whose brace has not opened
    started = False
    for i, line in enumerate(lines):
        words = line.replace("{", " { ").replace("}", " } ").split()
        at = 0  # the word that is looked at: a line may hold a whole file
        while at < len(words):
            head = words[at].upper()
            if head == "MOTION":
                if stack or pending or not nodes:
                    raise _fail(name, i, "MOTION", "comes before the hierarchy is closed" if nodes else "no joints")
                return nodes, i + 1
            if not started:
                if head != "HIERARCHY":
                    raise _fail(name, i, words[at], "a BVH file starts with HIERARCHY")
                started, at = True, at + 1
            elif head in ("ROOT", "JOINT", "END"):
                stop = next((k for k in range(at, len(words)) if words[k] == "{"), len(words))
                pending = _node(head, " ".join(words[at + 1 : stop]), nodes, stack, name, i)
                at = stop
            elif head == "{":
                if pending is None:
                    raise _fail(name, i, "{", "a joint's name must stand before its brace")
                nodes.append(pending)
                stack.append(len(nodes) - 1)
                pending, at = None, at + 1
            elif head == "}":
                if not stack:
                    raise _fail(name, i, "}", "closes a brace that was never opened")
                stack.pop()
                at += 1
            elif head in ("OFFSET", "CHANNELS") and stack:
                at = _property(words, at, nodes[stack[-1]], name, i)
            else:
                raise _fail(name, i, words[at], "expected ROOT, JOINT, End Site, OFFSET, CHANNELS or MOTION")
    rule = "the file ends before its MOTION section" if started else "a BVH file starts with HIERARCHY"
    raise _fail(name, max(len(lines) - 1, 0), "end of file", rule)


def _node(head: str, label: str, nodes: list[Node], stack: list[int], name: object, line: int) -> Node:
    if len(nodes) >= MOST_JOINTS:
        raise _fail(name, line, len(nodes), f"at most {MOST_JOINTS} joints")
    if head == "ROOT" and nodes:
        raise _fail(name, line, label, "only one ROOT is supported")
    if head != "ROOT" and not stack:
        raise _fail(name, line, label, "a joint outside of the root's braces")
    parent = stack[-1] if stack else -1
    if parent >= 0 and nodes[parent].end:
        raise _fail(name, line, label, "an end site has no children")
    if head == "END":
        return Node(f"{nodes[parent].name}_end", parent, end=True)
    if not label:
        raise _fail(name, line, head, "a joint needs a name")
    return Node(label, parent)


def _property(words: list[str], at: int, node: Node, name: object, line: int) -> int:
    """Read OFFSET or CHANNELS, the word `at`, into the node; the index of the word after it."""
    if words[at].upper() == "OFFSET":
        node.offset = _floats(words[at + 1 : at + 4], 3, name, line, "OFFSET")
        return at + 4
    count = words[at + 1] if at + 1 < len(words) else ""
    if count not in _COUNTS:
        raise _fail(name, line, " ".join(words[at : at + 2]), "CHANNELS must be followed by their number, 0 to 6")
    found = words[at + 2 : at + 2 + int(count)]
    channels = [CHANNELS[word.lower()] for word in found if word.lower() in CHANNELS]
    if len(found) != int(count) or len(set(channels)) != int(count):
        rule = "CHANNELS must name that many different X/Y/Zposition, X/Y/Zrotation"
        raise _fail(name, line, " ".join(words[at : at + 8]), rule)
    node.channels = channels
    return at + 2 + int(count)


def _key(text: str) -> str:
    return " ".join(text.lower().split())


def _header(lines: list[str], at: int, name: object) -> tuple[int, float, float]:
    """Frames, frame time, and by how much that is rounded."""
    found: dict[str, float] = {}
    exact = 0.0
    for i in range(at, len(lines)):
        line = lines[i].strip()
        if not line:
            continue
        before, _, value = line.partition(":")
        key = _key(before)
        if key not in _HEADER:
            raise _fail(name, i, line, "expected 'Frames: <count>' and 'Frame Time: <seconds>' after MOTION")
        (found[key],) = _floats(value.split(), 1, name, i, key)
        if not 0 < found[key] < FARTHEST or (key == "frames" and found[key] != int(found[key])):
            kind = "a whole number " * (key == "frames")
            raise _fail(name, i, value.strip(), f"{key} must be {kind}above 0 and below {FARTHEST:g}")
        exact = rounding(with_points(value.strip())) if key == "frame time" else exact
        if len(found) == 2:
            return int(found["frames"]), found["frame time"], exact
    raise _fail(name, len(lines) - 1, "end of file", "'Frames:' and 'Frame Time:' must follow MOTION")


def _rows(raw: RawBVH, at: _Numbers, name: object, told: Told) -> Iterator[np.ndarray]:
    """The frames' channel values; on trouble the first wrong line is looked up."""
    width = sum(len(node.channels) for node in raw.nodes)
    if raw.frames * width * 2 - 1 > at.end - at.start:  # a number takes two bytes with the space before it
        raise _numbers_error(raw.frames, width, at, name)
    read, frames = 0, raw.frames
    check_extent(name, _shown(raw, frames), frames * len(raw.nodes), at.end)
    at.file.seek(at.start)
    try:
        for rows in number_rows(at.file, at.end, width, told):
            read += len(rows)
            check_extent(name, _shown(raw, read), read * len(raw.nodes), at.end)
            yield rows
    except InputError:
        raise
    except ValueError:
        raise _numbers_error(frames, width, at, name) from None
    if read < frames:
        raise _numbers_error(frames, width, at, name)
    if read > frames:
        raw.notes.append(f"Frames: says {frames}, the file holds {read}; all of them were read")


def _shown(raw: RawBVH, frames: int) -> str:
    return f"{frames:,} frames of {len(raw.nodes):,} joints"


def _numbers_error(frames: int, width: int, at: _Numbers, name: object) -> InputError:
    rows, i = 0, at.lines
    at.file.seek(at.start)
    for i, line in enumerate(text_lines(at.file, at.end), at.lines):
        text = line.strip()
        if not text:
            continue
        rows += 1
        if len(line) > LONGEST_LINE:
            return _fail(name, i, f"more than {LONGEST_LINE:,} bytes", f"frame {rows} must hold {width} numbers")
        try:
            numbers = numbers_of(text)
        except ValueError:
            return _fail(name, i, text.decode("latin-1"), f"frame {rows} must hold numbers only")
        if not (finite := np.isfinite(numbers)).all():
            token = text.split()[int(np.argmin(finite))].decode("latin-1")
            return _fail(name, i, token, f"frame {rows} must be finite")
        if len(numbers) != width:
            return _fail(name, i, f"{len(numbers)} values", f"frame {rows} must hold {width} (as many as CHANNELS)")
    why = " (is the file truncated?)" if rows < frames else ""
    return _fail(name, max(i, at.lines - 1), f"{rows} frames", f"Frames: says {frames}{why}")


def render(nodes: list[Node], frame_time: float, values: np.ndarray) -> str:
    """The text of a BVH file: the inverse of `parse` (values to six digits after the point)."""
    children: list[list[int]] = [[] for _ in nodes]
    for i, node in enumerate(nodes[1:], 1):
        children[node.parent].append(i)
    lines = ["HIERARCHY"]
    _render_node(nodes, children, 0, 0, lines)
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {frame_time:.9f}"]
    template = " ".join(["%.6f"] * values.shape[1])
    lines += [template % tuple(row) for row in values.tolist()]
    return "\n".join(lines) + "\n"


def _render_node(nodes: list[Node], children: list[list[int]], i: int, depth: int, lines: list[str]) -> None:
    node, pad = nodes[i], "\t" * depth
    kind = "End Site" if node.end else f"{'JOINT' if depth else 'ROOT'} {node.name}"
    lines += [f"{pad}{kind}", f"{pad}{{", f"{pad}\tOFFSET " + " ".join(f"{x:.6f}" for x in node.offset or (0.0,) * 3)]
    if not node.end:
        names = " ".join("XYZ"[axis] + kind for kind, axis in node.channels)
        lines.append(f"{pad}\tCHANNELS {len(node.channels)} {names}")
    for child in children[i]:
        _render_node(nodes, children, child, depth + 1, lines)
    if not node.end and not children[i]:
        lines += [f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET 0.000000 0.000000 0.000000", f"{pad}\t}}"]
    lines.append(f"{pad}}}")
