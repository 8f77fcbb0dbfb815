"""Exciting trajectories for rigid dynamics.

Read `series`, `limits`, `criterion`, `problem`, `search`, `plan`, then `design`.
"""
