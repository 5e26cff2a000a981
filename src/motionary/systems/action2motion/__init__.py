"""Action labels to motion by a conditioned temporal VAE on Lie algebra poses (thesis chapter 3)."""
