"""Training: the one loop, its settings, checkpoints, tracking, and what every pipeline stage shares."""
