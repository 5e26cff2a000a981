"""What the dictionary does to made motions: feet that stand, on the floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from strides import on_the_floor, walker

from motionary.corpus.encoding import planted
from motionary.motion import Motion

STANDS = on_the_floor(walker())
PLANTED = on_the_floor(walker().plant_feet())


def raised(by: float) -> Motion:
    return replace(walker(), positions=STANDS + np.array([0, by, 0], np.float32))


@pytest.mark.parametrize("by", [-0.3, -0.04, 0.0, 0.03, 0.09])
def test_they_come_onto_the_floor(by):
    (found,) = planted([raised(by)])
    assert np.allclose(found.positions, PLANTED, atol=2e-5)


def test_who_climbs_stays_up():
    (found,) = planted([raised(0.6)])
    assert np.allclose(found.positions, raised(0.6).plant_feet().positions, atol=2e-5)


def test_a_motion_that_goes_on_keeps_its_height():
    (found,) = planted([raised(0.03)], first_frame=20)
    assert np.allclose(found.positions, raised(0.03).plant_feet(20).positions, atol=2e-5)


def test_unasked_nothing_moves():
    motion = raised(0.03)
    assert planted([motion], feet=False)[0] is motion
