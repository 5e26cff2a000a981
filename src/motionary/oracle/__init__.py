"""The oracle: reads from any motion, by geometry alone, what a caption may claim about it.

`read` a motion, derive what is `expected` of a caption, `confirm` one by the other. It learns nothing but a few cuts,
fixed on training clips (`fit_thresholds`), and shares nothing with the grammar of the demo corpus.
"""

from motionary.oracle.calibration import fit_thresholds
from motionary.oracle.claims import Claims, expected
from motionary.oracle.prompts import PROMPTS, Prompt, confirm, failures, holds
from motionary.oracle.reading import Attributes, read
from motionary.oracle.thresholds import DEFAULT, Thresholds

__all__ = [
    "DEFAULT",
    "PROMPTS",
    "Attributes",
    "Claims",
    "Prompt",
    "Thresholds",
    "confirm",
    "expected",
    "failures",
    "fit_thresholds",
    "holds",
    "read",
]
