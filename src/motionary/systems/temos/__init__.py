"""TEMOS: a transformer VAE with one latent for motion and text (Petrovich, Black, Varol, ECCV 2022)."""
