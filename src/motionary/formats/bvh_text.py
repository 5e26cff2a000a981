"""The text of a BVH file as arrays, and back: hierarchy, channels, numbers. What they mean is bvh.py's business."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np

from motionary.errors import InputError
from motionary.formats.read.extent import FARTHEST, check_extent
from motionary.motion.skeleton import MOST_JOINTS

CHANNELS = {f"{axis}{kind}": (kind, i) for kind in ("position", "rotation") for i, axis in enumerate("xyz")}
_COUNTS = tuple("0123456")
_ENDS = " \t\r\n\x00\x1a"  # what may stand after the last number: DOS marks the end of a text with 0x1A


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
    """The contents of a BVH file: nodes in file order, seconds per frame, values (T, all channels), and what is odd."""

    nodes: list[Node]
    frame_time: float
    values: np.ndarray
    notes: tuple[str, ...] = ()


def parse(text: str, name: object) -> RawBVH:
    """Parse a BVH file.

    Args:
        text: the contents.
        name: what to call the file in errors.

    Raises:
        InputError: names the file, the line and the rule that it breaks.
    """
    lines = text.rstrip(_ENDS).splitlines()
    nodes, at = _hierarchy(lines, name)
    frames, frame_time, at = _header(lines, at, name)
    width = sum(len(node.channels) for node in nodes)
    if width == 0:
        raise InputError(name, "no CHANNELS", "at least one joint must move")
    values = _numbers(lines, at, frames, width, name)
    check_extent(name, f"{len(values):,} frames of {len(nodes):,} joints", len(values) * len(nodes), len(text))
    notes = ()
    if len(values) > frames:
        notes = (f"Frames: says {frames}, the file holds {len(values)}; all of them were read",)
    return RawBVH(nodes, frame_time, values, notes)


def _fail(name: object, line: int, value: object, rule: str) -> InputError:
    return InputError(f"{name}, line {line + 1}", value, rule)


def _floats(tokens: list[str], count: int, name: object, line: int, what: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(token) for token in tokens)
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


def _header(lines: list[str], at: int, name: object) -> tuple[int, float, int]:
    """Frames, frame time, and the index of the first line of numbers."""
    found: dict[str, float] = {}
    for i in range(at, len(lines)):
        line = lines[i].strip()
        if not line:
            continue
        key, _, value = line.partition(":")
        key = " ".join(key.lower().split())
        if key not in ("frames", "frame time"):
            raise _fail(name, i, line, "expected 'Frames: <count>' and 'Frame Time: <seconds>' after MOTION")
        (found[key],) = _floats(value.split(), 1, name, i, key)
        if not 0 < found[key] < FARTHEST or (key == "frames" and found[key] != int(found[key])):
            kind = "a whole number " * (key == "frames")
            raise _fail(name, i, value.strip(), f"{key} must be {kind}above 0 and below {FARTHEST:g}")
        if len(found) == 2:
            return int(found["frames"]), found["frame time"], i + 1
    raise _fail(name, len(lines) - 1, "end of file", "'Frames:' and 'Frame Time:' must follow MOTION")


def _numbers(lines: list[str], at: int, frames: int, width: int, name: object) -> np.ndarray:
    """All channel values (frames or more, width), parsed at once; on trouble the first wrong line is looked up."""
    with warnings.catch_warnings():
        # numpy warns (or, later, raises) where text is not a number; the line search below says where.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(" ".join(lines[at:]), sep=" ")
        except (ValueError, DeprecationWarning):
            values = np.empty(0)
    if values.size >= frames * width and values.size % width == 0 and np.isfinite(values).all():
        return values.reshape(-1, width)
    raise _numbers_error(lines, at, frames, width, name)


def _numbers_error(lines: list[str], at: int, frames: int, width: int, name: object) -> InputError:
    rows = 0
    for i in range(at, len(lines)):
        tokens = lines[i].split()
        if not tokens:
            continue
        rows += 1
        try:
            numbers = np.array(tokens, np.float64)
        except ValueError:
            return _fail(name, i, lines[i].strip(), f"frame {rows} must hold numbers only")
        if not np.isfinite(numbers).all():
            return _fail(name, i, tokens[int(np.argmin(np.isfinite(numbers)))], f"frame {rows} must be finite")
        if len(tokens) != width:
            return _fail(name, i, f"{len(tokens)} values", f"frame {rows} must hold {width} (as many as CHANNELS)")
    why = " (is the file truncated?)" if rows < frames else ""
    return _fail(name, max(len(lines) - 1, 0), f"{rows} frames", f"Frames: says {frames}{why}")


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
