"""What is shown of an elastic fit.

To be read in this order: `content` (its rows), `gather` and `gather_resonances` (rows from artifacts), `resonances`,
`repeats`, `sections`, `summary`, and `report`, which puts all of it together.
"""
