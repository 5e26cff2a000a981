"""A trained pipeline in hand: text to motion, motion to text, styles, search. `load` opens it."""

from motionary.dictionary.dictionary import Dictionary, load
from motionary.dictionary.matches import Match

__all__ = ["Dictionary", "Match", "load"]
