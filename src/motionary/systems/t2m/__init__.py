"""T2M (thesis chapter 4): snippet codes, lengths from text, the temporal VAE."""
