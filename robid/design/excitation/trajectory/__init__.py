"""Exciting trajectories for rigid dynamics. Read `limits`, `problem`, then `design`."""
