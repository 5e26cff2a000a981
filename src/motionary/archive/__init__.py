"""A folder of any size, read once: captions, embeddings, flags of broken clips, near-duplicates, search by text."""

from motionary.archive.archive import Archive, Moment
from motionary.archive.indexing import index_folder

__all__ = ["Archive", "Moment", "index_folder"]
