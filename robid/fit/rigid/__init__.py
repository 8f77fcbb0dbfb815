"""Rigid dynamics. Read `rows`, `preprocessing`, `reduction`, `least_squares`, `huber`, `instruments`, then `verdict`."""
