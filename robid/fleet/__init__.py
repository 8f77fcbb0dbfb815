"""An experiment file over the rows of a manifest.

Read `manifest`, `robots`, `rows`, `ledger`, `folders`, `row`, `run`. What comes out of a row is in `results` and
`pages`, what comes out of all of them in `collected`, `comparison`, `table`, `summary` and `page`.
"""
