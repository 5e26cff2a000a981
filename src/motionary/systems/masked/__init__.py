"""Masked generation on residual motion tokens (Guo, Mu, Javed, Wang, Cheng: MoMask, CVPR 2024)."""
