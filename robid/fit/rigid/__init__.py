"""Rigid dynamics. Read `base`, `rows`, `preprocessing`, `reduction`, `least_squares`, `huber`, then `verdict`."""
