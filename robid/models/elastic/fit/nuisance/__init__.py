"""Nuisance parameters: what a robot file may have wrong, and what a fit makes of that.

Read `kinds`, the table of them, with `effects`, what they do, `owners`, of what, and `moves`, which makes the robots;
`listing`, those of one robot; `scene`, `columns` and `response`, how they act on one; `off_robot`, the
fit's problem for a robot that is off; `linear` and `joint`, which estimate them along; `missing_springs`, those that
are beyond a first order; and `wording`.
"""
