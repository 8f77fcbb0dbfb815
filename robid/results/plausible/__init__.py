"""Data held against the robot file before any fit. Read `evidence`, `angles`, `gravity`, `scales`, then `findings`."""
