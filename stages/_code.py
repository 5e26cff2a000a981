"""Says what is wrong with the configuration, and writes down what the code of every stage is, so that DVC sees which
have changed. DVC always runs it, before all others (not `code.py`: Python has one)."""

import sys

from _project import ROOT  # isort: skip
from motionary.errors import InputError
from motionary.pipeline.check import check_params
from motionary.pipeline.code import write_code

if __name__ == "__main__":
    try:
        check_params(ROOT)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    write_code(ROOT)
