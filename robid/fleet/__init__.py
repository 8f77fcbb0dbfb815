"""An experiment file over the rows of a manifest.

Read `manifest`, `rows`, `ledger`, `folders`, `row`, `run`. What comes out of all rows is in `comparison`, with
`population` and `drift`, and goes to `table`, `summary`, and, by way of `sections`, to `report`.
"""
