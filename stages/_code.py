"""Writes down what the code of every stage is, so that DVC sees which have changed (not `code.py`: Python has one)."""

from _project import ROOT  # isort: skip
from motionary.pipeline.code import write_code

if __name__ == "__main__":
    write_code(ROOT)
