"""Exciting trajectories for rigid dynamics. Read `series`, `limits`, `criterion`, `search`, then `design`."""
