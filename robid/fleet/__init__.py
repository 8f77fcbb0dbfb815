"""An experiment file over the rows of a manifest.

Read `manifest`, `rows`, `ledger`, `folders`, `row`, `run`; what comes out is in `results`, `table` and `report`.
"""
