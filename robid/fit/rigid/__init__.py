"""Rigid dynamics. Read `rows`, `preprocessing`, `reading`, `reduction`, `least_squares`, `huber`, then `verdict`."""
