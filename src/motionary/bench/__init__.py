"""One-thread CPU time and peak memory of the expensive work, at the papers' shapes: ``python -m motionary.bench``."""
