"""Motion files: readers, writers and pictures, each loaded only when a file asks for it."""

from motionary.formats.read import READERS, read_motion
from motionary.formats.write import WRITERS, write_motion

__all__ = ["READERS", "WRITERS", "read_motion", "write_motion"]
