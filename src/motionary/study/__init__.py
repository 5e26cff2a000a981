"""Experiments over seeds, splits and ablations: planned, run, compared."""
