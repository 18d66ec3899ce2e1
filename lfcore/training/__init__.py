"""Training of the networks: patches from light fields, the loop, its checkpoints and curves."""
