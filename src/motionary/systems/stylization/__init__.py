"""Latent stylization (thesis chapter 5): motion codes, root velocities, style transfer."""
