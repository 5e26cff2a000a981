"""Which way is up, which side is left and how long a unit is, measured on a motion as its file gives it."""

from motionary.formats.measure.body_frame import BodyFrame, body_of
from motionary.formats.measure.evidence import SURE, Choice
from motionary.formats.measure.handedness import measure_mirror
from motionary.formats.measure.unit import UNITS, measure_unit
from motionary.formats.measure.up import AXES, measure_up

__all__ = ["AXES", "SURE", "UNITS", "BodyFrame", "Choice", "body_of", "measure_mirror", "measure_unit", "measure_up"]
