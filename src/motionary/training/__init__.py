"""Training: the one loop, its settings, learning rates, checkpoints and devices."""
