"""What knows DVC, Hydra and MLflow: stages, workspaces, tracking, code hashes, the parallel repro."""
