"""The stages: one module per command, from settings and input artifacts to an output artifact."""
