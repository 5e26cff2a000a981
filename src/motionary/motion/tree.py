"""What a rig's tree and bone lengths tell, whatever its joints are called: two legs, two arms, a trunk between them.

A limb is a branch that has a twin of the same shape and lengths. Legs and arms are the two heaviest pairs of twins that
hang from different joints of one trunk; the arms' joint is the one that also carries the head. Within a limb the two
long bones of nearly equal length are found, past collars, twist bones and placement joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from motionary.motion.rigs import sides_of

_ALIKE = 0.1  # twins' bones differ by less than this part of their length
_UNLIKE = 0.8  # a limb whose bones fit worse than this is none
_APART = 0.2  # both shoulders, and both hips, are further apart than this part of an upper bone
_TURNED = 0.2  # sine of the angle below which a direction says nothing


@dataclass(frozen=True)
class _Twins:
    """Two limbs of one joint: their longest ways down, joint by joint, and the length of one."""

    base: int
    ways: tuple[tuple[int, ...], tuple[int, ...]]
    length: float


def roles_by_tree(
    joints: Sequence[str], parents: Sequence[int], offsets: np.ndarray, poses: np.ndarray | None = None
) -> dict[str, int]:
    """Joint index by role of a rig with a human tree; empty where it has none, or where left and right stay unknown.

    Args:
        joints: names, of which only words and letters for left and right are used, and only where the rest pose does
            not tell the sides.
        parents: (J,) -1 for the root, parents before children.
        offsets: (J, 3) rest offsets, any unit and axes.
        poses: (T, J, 3) joint positions of some frames, which tell left from right where the rest pose does not.
    """
    tree = _Tree(tuple(parents), np.asarray(offsets, np.float64))
    places = tree.place[None] if poses is None else np.asarray(poses, np.float64)
    for arms, legs in _limbs(tree):
        thighs = _long_bones(tree, places, legs, 0.55, 0.95)
        upper = _long_bones(tree, places, arms, 0.45, 1.0)
        if thighs is None or upper is None:
            continue
        side = _left_first(places, joints, legs, thighs, arms)
        if side is None:
            return {}
        return _named(tree, legs, thighs, arms, upper, side)
    return {}


def common_ancestor(parents: Sequence[int], a: int, b: int) -> int:
    """The lowest joint that has both below it (or is one of them)."""
    above = set()
    while a >= 0:
        above.add(a)
        a = parents[a]
    while b not in above:
        b = parents[b]
    return b


class _Tree:
    def __init__(self, parents: tuple[int, ...], offsets: np.ndarray):
        self.parents, self.lengths = parents, np.linalg.norm(offsets, axis=-1)
        self.children: list[list[int]] = [[] for _ in parents]
        self.place = np.zeros_like(offsets)
        for joint, parent in enumerate(parents[1:], 1):
            self.children[parent].append(joint)
            self.place[joint] = self.place[parent] + offsets[joint]
        self.reach = np.zeros(len(parents))  # the longest way from a joint down to a leaf
        self.weight = np.zeros(len(parents))  # all bones at and below a joint
        for joint in range(len(parents) - 1, -1, -1):
            kids = self.children[joint]
            self.reach[joint] = max((self.lengths[k] + self.reach[k] for k in kids), default=0.0)
            self.weight[joint] = self.lengths[joint] + sum(self.weight[k] for k in kids)

    def way(self, joint: int) -> tuple[int, ...]:
        """From a joint down its longest branch."""
        found = [joint]
        while kids := self.children[found[-1]]:
            found.append(max(kids, key=lambda k: self.lengths[k] + self.reach[k]))
        return tuple(found)

    def path(self, top: int, joint: int) -> list[int]:
        """Joints on the way from `top`, which is left out, down to `joint`, which is included."""
        found = []
        while joint not in (top, -1):
            found.append(joint)
            joint = self.parents[joint]
        return found[::-1]


def _limbs(tree: _Tree) -> Iterator[tuple[_Twins, _Twins]]:
    """(arms, legs), the heaviest first."""
    pairs = sorted(_twins(tree), key=lambda pair: -pair.length)
    whole = max(tree.reach[0], 1e-9)
    pairs = [pair for pair in pairs if pair.length > 0.25 * whole]
    for one, other in combinations(pairs, 2):
        if one.base == other.base:
            continue
        meet = common_ancestor(tree.parents, one.base, other.base)
        # Arms leave the trunk further from the root, at or below a joint that carries more than the limbs: the head.
        depth = [len(tree.path(-1, pair.base)) for pair in (one, other)]
        nearer, further = (one, other) if depth[0] < depth[1] else (other, one)
        inside = {joint for way in nearer.ways for joint in way}
        if further.base in inside or meet == further.base:
            continue
        yield further, nearer


def _twins(tree: _Tree) -> Iterator[_Twins]:
    for joint, kids in enumerate(tree.children):
        for a, b in combinations(kids, 2):
            one, other = tree.way(a), tree.way(b)
            size = tree.reach[a] + tree.lengths[a]
            if len(one) != len(other) or len(one) < 3 or size <= 0:
                continue
            first, second = tree.lengths[list(one)], tree.lengths[list(other)]
            if np.abs(first - second).max() < _ALIKE * size:
                yield _Twins(joint, (one, other), float(size))


def _long_bones(
    tree: _Tree, places: np.ndarray, pair: _Twins, least: float, ratio: float
) -> tuple[int, int, int] | None:
    """Places in the ways of the joints where the upper bone begins, where it meets the lower one, and where that ends.

    Upper and lower stand in about the ratio given, fill most of the limb and leave a foot or a hand behind them.
    """
    one, other = pair.ways
    length = (tree.lengths[list(one)] + tree.lengths[list(other)]) / 2
    at = np.concatenate([[0.0], np.cumsum(length[1:])])  # of each joint, from the first one on
    apart = np.median(np.linalg.norm(places[:, one] - places[:, other], axis=-1), axis=0)
    best, cost = None, _UNLIKE
    for a, b, c in combinations(range(len(at)), 3):
        upper, lower = at[b] - at[a], at[c] - at[b]
        if min(upper, lower) <= 0 or upper + lower < least * at[-1] or apart[a] < _APART * upper:
            continue
        behind = (at[-1] - at[c]) / (upper + lower)
        loss = 2 * abs(np.log(upper / lower / ratio)) + at[a] / at[-1] + 3 * max(0.0, behind - 0.45)
        loss += 0.15 * (c - a - 2)  # joints within a bone: twist bones are the exception, and lie on its line
        loss += 4 * (_bent(places, one, a, b) + _bent(places, one, b, c))
        loss += 0.3 * (behind < 0.02)
        loss -= 0.3 * min(max(len(tree.children[one[c]]) - 1, 0), 2)  # fingers
        if loss < cost:
            best, cost = (a, b, c), loss
    return best


def _bent(places: np.ndarray, way: Sequence[int], begin: int, end: int) -> float:
    """How far joints between two others lie off their line, in parts of its length; the median over (T, J, 3) poses."""
    if end - begin < 2:
        return 0.0
    line = places[:, way[end]] - places[:, way[begin]]
    inside = places[:, way[begin + 1 : end]] - places[:, way[begin]][:, None]
    off = np.linalg.norm(np.cross(inside, _unit(line)[:, None]), axis=-1).max(-1)
    return float(np.median(off / np.maximum(np.linalg.norm(line, axis=-1), 1e-12)))


def _left_first(
    places: np.ndarray, joints: Sequence[str], legs: _Twins, thighs: tuple[int, int, int], arms: _Twins
) -> tuple[bool, bool] | None:
    """Whether each pair (legs, arms) has its left limb first: by the names, else by toes and knees in (T, J, 3) poses.

    The left is where up x ahead points, up along the trunk. A pose whose legs do not go on from the trunk, as in rest
    poses that lay every bone along one axis, shows no such thing.
    """
    a, _b, c = thighs
    hips, knees, ankles = ([places[:, way[spot]] for way in legs.ways] for spot in thighs)
    up = _unit(places[:, arms.base] - (hips[0] + hips[1]) / 2)
    ahead = np.zeros_like(up)
    for k, way in enumerate(legs.ways):
        if len(way) > c + 1:
            ahead += _unit(places[:, way[c + 1]] - ankles[k])
        ahead += _unit(knees[k] - hips[k]) + _unit(knees[k] - ankles[k])
    down = _unit(ankles[0] + ankles[1] - hips[0] - hips[1])
    ahead -= (ahead * up).sum(-1, keepdims=True) * up
    told = ((up * down).sum(-1) < -0.7) & (np.linalg.norm(ahead, axis=-1) > _TURNED)
    left = np.cross(up, _unit(ahead))[told]
    found = []
    for pair, spot in ((legs, a), (arms, -1)):
        word = _said(joints, pair)
        across = _unit(places[told, pair.ways[0][spot]] - places[told, pair.ways[1][spot]])
        cosine = float((across * left).sum(-1).mean()) if told.any() else 0.0
        if not word and abs(cosine) < _TURNED:
            return None
        found.append(word == "left" if word else cosine > 0)
    return found[0], found[1]


def _said(joints: Sequence[str], pair: _Twins) -> str:
    """The side that the first limb's names say, "" where they say none or both."""
    words = sides_of(tuple(joints[j] for way in pair.ways for j in way))
    half = len(pair.ways[0])
    first, second = set(words[:half]) - {""}, set(words[half:]) - {""}
    return first.pop() if len(first) == len(second) == 1 and first != second else ""


def _named(
    tree: _Tree,
    legs: _Twins,
    thighs: tuple[int, int, int],
    arms: _Twins,
    upper: tuple[int, int, int],
    first: tuple[bool, bool],
) -> dict[str, int]:
    meet = common_ancestor(tree.parents, legs.base, arms.base)
    roles = {"pelvis": meet}
    for pair, spots, names, left in (
        (legs, thighs, ("hip", "knee", "ankle", "foot"), first[0]),
        (arms, upper, ("shoulder", "elbow", "wrist", ""), first[1]),
    ):
        for way, side in zip(pair.ways, ("left", "right") if left else ("right", "left"), strict=True):
            roles |= {f"{side}_{name}": way[spot] for name, spot in zip(names, spots, strict=False)}
            if names[3] and len(way) > spots[2] + 1:
                roles[f"{side}_{names[3]}"] = way[spots[2] + 1]
            if not names[3] and spots[0] > 0:
                roles[f"{side}_collar"] = way[0]
    spine = tree.path(meet, arms.base)
    if len(spine) >= 1:
        roles["spine3"] = spine[-1]
    if len(spine) >= 2:
        roles["spine1"] = spine[0]
    if len(spine) >= 3:
        roles["spine2"] = spine[(len(spine) - 1) // 2]
    limbs = {way[0] for way in arms.ways}
    if others := [child for child in tree.children[arms.base] if child not in limbs]:
        head = tree.way(max(others, key=lambda k: tree.lengths[k] + tree.reach[k]))
        roles["neck"] = head[0]
        if len(head) > 1:
            roles["head"] = head[1 if len(head) < 4 else 2]
    return roles


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
