"""`read`: what a motion shows, by geometry alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motionary.oracle import arms, legs
from motionary.oracle.signals import signals
from motionary.oracle.thresholds import DEFAULT, Thresholds

if TYPE_CHECKING:
    from motionary.motion import Motion


@dataclass(frozen=True)
class Attributes:
    """What the oracle reads from a motion. Sides are "none", "left", "right" or "both".

    Attributes:
        raised: hands that rise.
        above_head: hands that rise above the head joint.
        waving: raised hands that swing to and fro.
        pointing: straight arms that stay near the horizontal.
        low: hands that reach down to the floor.
        gait: "still", "walk" or "run".
        direction: where the body goes as seen by itself: "none", "forward", "backward", "left" or "right".
        displacement: (left, forward) metres from start to end in the frame of the first heading.
        distance: metres the root travels.
        speed: metres per second while it travels (median).
        turn: degrees from first to last heading, positive to the left.
        turned: sides of large changes of heading.
        turned_left, turned_right: the largest change of heading to either side, degrees.
        jumps: flights of both feet together.
        hops_left, hops_right: flights of one foot while the other stays off the floor.
        squats, sits, bows: how often the hips sink over the feet, or as on a seat, or the trunk bends forward and up.
        leans_left, leans_right, kicks_left, ...: how often the trunk, a foot, a knee, a hand, a fist does so.
        circles_left, circles_right: full turns of an arm.
        claps: how often the hands meet.
    """

    raised: str
    above_head: str
    waving: str
    pointing: str
    low: str
    gait: str
    direction: str
    displacement: tuple[float, float]
    distance: float
    speed: float
    turn: float
    turned: str
    turned_left: float
    turned_right: float
    jumps: int
    hops_left: int
    hops_right: int
    squats: int
    sits: int
    bows: int
    leans_left: int
    leans_right: int
    kicks_left: int
    kicks_right: int
    knees_left: int
    knees_right: int
    lunges_left: int
    lunges_right: int
    raises_left: int
    raises_right: int
    punches_left: int
    punches_right: int
    circles_left: int
    circles_right: int
    claps: int


def read(motion: Motion, thresholds: Thresholds = DEFAULT) -> Attributes:
    """Attributes of a motion of any skeleton with limbs, at any rate; facing and place do not matter.

    Raises:
        InputError: the skeleton lacks a limb.
    """
    s, cut = signals(motion), thresholds
    gait, speed = legs.gait(s, cut)
    raised = arms.raised(s, cut, moving=gait != "still")
    left, right = legs.turns(s)
    squats, sits = legs.squats(s, cut)
    pairs = {
        "hops": legs.hops(s, cut),
        "leans": legs.leans(s, cut),
        "kicks": legs.kicks(s, cut),
        "knees": legs.knees(s, cut),
        "lunges": legs.lunges(s, cut),
        "raises": arms.raises(s, cut),
        "punches": arms.punches(s, cut),
        "circles": arms.circles(s),
    }
    return Attributes(
        raised=_side(raised),
        above_head=_side(raised & (s.over_head.max(0) > 0)),
        waving=_side(raised & (arms.swings(s, cut) > cut.wave_swings)),
        pointing=_side(arms.pointing(s, cut)),
        low=_side(arms.reaches_down(s, cut)),
        gait=gait,
        direction=legs.direction(s, cut),
        displacement=legs.displacement(s),
        distance=float(np.sqrt(np.square(np.diff(s.path, axis=0)).sum(-1)).sum()),
        speed=speed,
        turn=float(s.heading[-1] - s.heading[0]),
        turned=_side((left > cut.turn, right > cut.turn)),
        turned_left=left,
        turned_right=right,
        jumps=legs.jumps(s, cut),
        squats=squats,
        sits=sits,
        bows=legs.bows(s, cut),
        claps=arms.claps(s, cut),
        **{f"{name}_left": counts[0] for name, counts in pairs.items()},
        **{f"{name}_right": counts[1] for name, counts in pairs.items()},
    )


def _side(hands) -> str:
    """Two flags as a word."""
    return ("none", "left", "right", "both")[int(hands[0]) + 2 * int(hands[1])]
