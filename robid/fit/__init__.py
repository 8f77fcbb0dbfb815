"""Fits: problem, solution, optimizer, uncertainty, families."""
