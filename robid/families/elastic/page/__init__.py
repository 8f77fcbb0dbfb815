"""What is shown of an elastic fit.

To be read in this order: `content` (its rows), `gather` (rows from artifacts), `resonances`, `sections`, `summary`, and
`report`, which puts all of it together.
"""
