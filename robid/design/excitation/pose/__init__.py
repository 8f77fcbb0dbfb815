"""Chirps of the commanded pose. Read `motion`, `limits`, then `design`."""
