"""``python -m motionary.cli``, the same as ``motionary``."""

import sys

from motionary.cli import main

sys.exit(main())
